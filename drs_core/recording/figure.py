"""Recorded and replayed actions over time."""

from __future__ import annotations

from pathlib import Path

from drs_core.recording.replay import Replay
from drs_core.reporting.colours import LIGHT
from drs_core.reporting.figures import save_figure

_ROW_HEIGHT = 1.7


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
    save_figure(figure, path)
