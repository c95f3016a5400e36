"""The paper's figure of a Panda arm: tip position and velocity over time, before beside after."""

from __future__ import annotations

import importlib.util
import io
from pathlib import Path

import numpy as np

from drs_core.episode import Episode
from drs_core.errors import DrsError, UsageError
from drs_core.files import write_atomically
from drs_core.measures.smoothness import CONTROL_PERIOD_S

_AXES = ("x", "y", "z")
FORMATS = (".png", ".svg", ".pdf")


def check_figure(path: Path, environment_id: str) -> None:
    """Find out before a long computation that the figure could not be drawn after it.

    Raises:
        UsageError: the path is no figure's, or the environment has no tip to draw.
        DrsError: matplotlib is missing.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise DrsError("A figure needs matplotlib; install it with: pip install 'drs[report]'.")
    if not environment_id.startswith("Panda"):
        raise UsageError(f"A figure shows the tip of an arm, and {environment_id} has none; leave out --figure.")
    if path.suffix not in FORMATS:
        raise UsageError(f"A figure is written as {', '.join(FORMATS)}; {path.name} is none of them.")
    if not path.absolute().parent.is_dir():
        raise UsageError(f"The folder {path.absolute().parent} does not exist; make it first.")


def tip_motion_figure(before: Episode, after: Episode, path: Path) -> None:
    """Draw two episodes that recorded their tip; path ends in .png, .svg or .pdf.

    Raises:
        ValueError: an episode did not record its tip.
        DrsError: the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    for column, (label, episode) in enumerate((("before", before), ("after", after))):
        if episode.tip_position is None or episode.tip_velocity is None:
            raise ValueError("the episode was run without recording its tip")
        time_s = CONTROL_PERIOD_S * np.arange(1, episode.length + 1)
        for row, series in enumerate((episode.tip_position, episode.tip_velocity)):
            for axis in range(3):
                axes[row, column].plot(time_s, series[:, axis], label=_AXES[axis], linewidth=1.3)
            axes[row, column].grid(alpha=0.3)
        axes[0, column].set_title(f"{label} (seed {episode.seed}, return {episode.return_:g})")
        axes[1, column].set_xlabel("time [s]")
    axes[0, 0].set_ylabel("tip position [m]")
    axes[1, 0].set_ylabel("tip velocity [m/s]")
    axes[0, 1].legend(loc="upper right")
    buffer = io.BytesIO()
    figure.savefig(buffer, format=path.suffix[1:], dpi=150)
    write_atomically(path, buffer.getvalue())
