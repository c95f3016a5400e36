"""Recorded and replayed actions over time."""

from __future__ import annotations

import importlib.util
import io
from pathlib import Path

from drs_core.errors import DrsError, UsageError
from drs_core.files import check_writable, write_atomically
from drs_core.recording.replay import Replay
from drs_core.reporting.colours import LIGHT
from drs_core.reporting.figures import FORMATS

_ROW_HEIGHT = 1.7


def check_figure(path: Path, force: bool) -> None:
    """Find out before the work that the figure could not be drawn.

    Raises:
        UsageError: the name, the folder or what is there already is in the way.
        DrsError: matplotlib is missing.
    """
    if importlib.util.find_spec("matplotlib") is None:
        raise DrsError("A figure needs matplotlib; install it with: pip install 'drs[report]'.")
    if path.suffix not in FORMATS:
        raise UsageError(f"A figure is written as {', '.join(FORMATS)}; {path.name} is none of them.")
    check_writable(path, force)


def action_figure(result: Replay, path: Path) -> None:
    """Draw a row for each action, what was recorded and what the agent would have done.

    Raises:
        DrsError: the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    count = result.recorded.shape[1]
    figure = Figure(figsize=(10, 1.0 + _ROW_HEIGHT * count), layout="constrained")
    FigureCanvasAgg(figure)
    rows = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    for index, axes in enumerate(rows):
        # the wide one below, so that both are seen where they are equal
        axes.plot(result.times_s, result.recorded[:, index], label="recorded", color=LIGHT.before, linewidth=3.0)
        axes.plot(result.times_s, result.replayed[:, index], label="replayed", color=LIGHT.after, linewidth=1.2)
        axes.set_ylabel(f"action {index}")
        axes.grid(alpha=0.3)
    rows[0].legend(loc="upper right", ncols=2)
    rows[-1].set_xlabel("time [s]")
    buffer = io.BytesIO()
    figure.savefig(buffer, format=path.suffix[1:], dpi=150)
    write_atomically(path, buffer.getvalue())
