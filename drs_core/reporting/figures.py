"""The paper's figure of a Panda arm: tip position and velocity over time, before beside after."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from drs_core.episode import Episode
from drs_core.errors import DrsError, UsageError
from drs_core.files import write_atomically
from drs_core.measures.smoothness import CONTROL_PERIOD_S

_AXES = ("x", "y", "z")
FORMATS = (".png", ".svg", ".pdf")


def check_figure_path(path: Path) -> None:
    """Raise UsageError before a long computation, where the figure could not be written after it."""
    if path.suffix not in FORMATS:
        raise UsageError(f"A figure is written as {', '.join(FORMATS)}; {path.name} is none of them.")
    if not path.absolute().parent.is_dir():
        raise UsageError(f"The folder {path.absolute().parent} does not exist; make it first.")


def tip_motion_figure(before: Episode, after: Episode, path: Path) -> None:
    """Draw two episodes that recorded their tip; path ends in .png, .svg or .pdf.

    Raises:
        UsageError: the episodes have no tip: the environment is no Panda.
        DrsError: matplotlib is missing or the file cannot be written.
    """
    import io

    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ModuleNotFoundError as error:
        raise DrsError("A figure needs matplotlib; install it with: pip install 'drs[report]'.") from error
    figure = Figure(figsize=(10, 6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    for column, (label, episode) in enumerate((("before", before), ("after", after))):
        if episode.tip_position is None or episode.tip_velocity is None:
            raise UsageError("The figure shows the tip of an arm; these agents are of an environment without one.")
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
