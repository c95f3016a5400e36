"""Return against rollouts: a small panel an agent, the goal as a line."""

from __future__ import annotations

import io
import math
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from drs_core.files import write_atomically
from drs_core.reporting.colours import LIGHT

_COLUMNS = 4
_FIRST = 16
"""Where the baseline stands, which has needed none and no logarithm has."""
_COLOURS = (LIGHT.before, LIGHT.after, LIGHT.goal, LIGHT.axes[2], LIGHT.muted)
_STYLES: list[dict[str, Any]] = [
    {"color": colour, "linestyle": line} for line in ("-", ":", "-.") for colour in _COLOURS
]
"""Of the methods, more than there are; dashes are the goal's."""
_GOAL: dict[str, Any] = {"color": LIGHT.foreground, "linestyle": "--", "linewidth": 1}


def draw(result: dict[str, Any], path: Path) -> None:
    """Draw a result; path ends in .png, .svg or .pdf.

    Raises:
        DrsError: the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    agents = result["agents"]
    columns = min(_COLUMNS, len(agents))
    rows = math.ceil(len(agents) / columns)
    # not of what is drawn in some panel: a method whose searches wait there belongs here too
    legend = [Line2D([], [], label="goal", **_GOAL)]
    styles = dict(zip(result["titles"], cycle(_STYLES)))
    legend += [Line2D([], [], label=title, **styles[method]) for method, title in result["titles"].items()]
    beside = min(len(legend), math.ceil(1.5 * columns))
    below = math.ceil(len(legend) / beside)
    figure = Figure(figsize=(3.2 * columns, 2.4 * rows + 0.25 * (1 + below)), layout="constrained")
    FigureCanvasAgg(figure)
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for axes, (name, agent) in zip(panels, agents.items()):
        _panel(axes, name, agent, styles)
    for axes in panels[len(agents) :]:
        axes.set_visible(False)
    figure.legend(handles=legend, loc="outside lower center", ncols=beside, fontsize=8, columnspacing=1, frameon=False)
    content = io.BytesIO()
    figure.savefig(content, format=path.suffix[1:], dpi=120)
    write_atomically(path, content.getvalue())


def _panel(axes: Any, name: str, agent: dict[str, Any], styles: dict[str, dict[str, Any]]) -> None:
    from matplotlib.ticker import NullFormatter

    axes.set_title(name, fontsize=10)
    axes.set_xscale("log")
    # a span of less than a decade would write every minor tick, one over the other
    axes.xaxis.set_minor_formatter(NullFormatter())
    if agent["goal"]["objective"] == "smooth":
        axes.set_yscale("log")
    axes.axhline(agent["goal"]["line"], **_GOAL)
    for method, found in agent["methods"].items():
        for curve in filter(None, found["curves"]):
            rollouts, shown = np.array(curve).T
            axes.plot(np.maximum(rollouts, _FIRST), shown, linewidth=0.8, alpha=0.8, **styles[method])
    axes.set_xlabel("rollouts", fontsize=8)
    axes.set_ylabel(agent["goal"]["label"], fontsize=8)
    axes.tick_params(labelsize=8)
    axes.grid(color=LIGHT.grid, linewidth=0.5)
