"""The paper's figure of a Panda arm: tip position and velocity over time, before beside after."""

from __future__ import annotations

import importlib.util
import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from drs_core.episode import Episode
from drs_core.errors import DrsError, UsageError, install
from drs_core.files import write_atomically
from drs_core.measures.smoothness import CONTROL_PERIOD_S
from drs_core.reporting.colours import LIGHT, Palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_AXES = ("x", "y", "z")
QUANTITIES = {"position": "tip position [m]", "velocity": "tip velocity [m/s]"}
"""What a tip does over time, and how its axis is called."""
FORMATS = (".png", ".svg", ".pdf")


def check_figure(path: Path, environment_id: str) -> None:
    """Find out before a long computation that the figure could not be drawn after it.

    Raises:
        UsageError: the path is no figure's, or the environment has no tip to draw.
        DrsError: matplotlib is missing.
    """
    if not environment_id.startswith("Panda"):
        raise UsageError(f"A figure shows the tip of an arm, and {environment_id} has none; leave out --figure.")
    check_figure_file(path)


def check_figure_file(path: Path) -> None:
    """Find out before the work that no figure could be written there.

    Raises:
        UsageError: the name is no figure's, or the folder does not exist.
        DrsError: matplotlib is missing.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise DrsError(f"A figure needs matplotlib; {install('report')}.")
    if path.suffix not in FORMATS:
        raise UsageError(f"A figure is written as {', '.join(FORMATS)}; {path.name} is none of them.")
    if not path.absolute().parent.is_dir():
        raise UsageError(f"The folder {path.absolute().parent} does not exist; make it first.")


def draw_tip(axes: Axes, episode: Episode, quantity: str, palette: Palette = LIGHT) -> None:
    """Draw the three coordinates of a key of QUANTITIES over time.

    Raises:
        ValueError: the episode did not record its tip.
    """
    series = {"position": episode.tip_position, "velocity": episode.tip_velocity}[quantity]
    if series is None:
        raise ValueError("the episode was run without recording its tip")
    time_s = CONTROL_PERIOD_S * np.arange(1, episode.length + 1)
    for axis, (name, colour) in enumerate(zip(_AXES, palette.axes, strict=True)):
        axes.plot(time_s, series[:, axis], label=name, color=colour, linewidth=1.4)


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
        for row, quantity in enumerate(QUANTITIES):
            draw_tip(axes[row, column], episode, quantity)
            axes[row, column].grid(alpha=0.3)
        axes[0, column].set_title(f"{label} (seed {episode.seed}, return {episode.return_:g})")
        axes[1, column].set_xlabel("time [s]")
    for row, name in enumerate(QUANTITIES.values()):
        axes[row, 0].set_ylabel(name)
    axes[0, 1].legend(loc="upper right")
    save_figure(figure, path)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure in the format that its name says.

    Raises:
        DrsError: the file cannot be written.
    """
    buffer = io.BytesIO()
    figure.savefig(buffer, format=path.suffix[1:], dpi=150)
    write_atomically(path, buffer.getvalue())
