"""Return against rollouts: a small panel an agent, the goal as a line."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

import numpy as np

from drs_core.files import write_atomically
from drs_core.reporting.colours import LIGHT

_COLUMNS = 4
_FIRST = 16
"""Where the baseline stands, which has needed none and no logarithm has."""
_COLOURS = (LIGHT.before, LIGHT.after, LIGHT.goal, LIGHT.axes[2], LIGHT.muted)


def draw(result: dict[str, Any], path: Path) -> None:
    """Draw a result; path ends in .png, .svg or .pdf.

    Raises:
        DrsError: the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    agents = result["agents"]
    rows = math.ceil(len(agents) / _COLUMNS)
    figure = Figure(figsize=(3.2 * min(_COLUMNS, len(agents)), 2.4 * rows + 0.5), layout="constrained")
    FigureCanvasAgg(figure)
    panels = list(figure.subplots(rows, min(_COLUMNS, len(agents)), squeeze=False).flat)
    for axes, (name, agent) in zip(panels, agents.items()):
        _panel(axes, name, agent, result)
    for axes in panels[len(agents) :]:
        axes.set_visible(False)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(6, len(labels)), frameon=False)
    content = io.BytesIO()
    figure.savefig(content, format=path.suffix[1:], dpi=120)
    write_atomically(path, content.getvalue())


def _panel(axes: Any, name: str, agent: dict[str, Any], result: dict[str, Any]) -> None:
    from matplotlib.ticker import NullFormatter

    axes.set_title(name, fontsize=10)
    axes.set_xscale("log")
    # a span of less than a decade would write every minor tick, one over the other
    axes.xaxis.set_minor_formatter(NullFormatter())
    if agent["goal"]["objective"] == "smooth":
        axes.set_yscale("log")
    axes.axhline(agent["goal"]["line"], color=LIGHT.foreground, linewidth=1, linestyle="--", label="goal")
    for colour, (method, found) in zip(_COLOURS, agent["methods"].items()):
        for place, curve in enumerate(found["curves"]):
            if not curve:
                continue
            rollouts, shown = np.array(curve).T
            label = result["titles"][method] if place == 0 else None
            axes.plot(np.maximum(rollouts, _FIRST), shown, color=colour, linewidth=0.8, alpha=0.8, label=label)
    axes.set_xlabel("rollouts", fontsize=8)
    axes.set_ylabel(agent["goal"]["label"], fontsize=8)
    axes.tick_params(labelsize=8)
    axes.grid(color=LIGHT.grid, linewidth=0.5)
