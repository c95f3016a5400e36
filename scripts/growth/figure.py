"""Rollouts a second over the number of simulators, a panel an agent."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from drs_core.reporting.colours import LIGHT
from drs_core.reporting.figures import save_figure
from scripts.growth.points import AS_IT_IS, DIRECTIONS, NEAR, ONE_CLIENT, ONE_LINK, Point

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS = dict(zip(DIRECTIONS, (LIGHT.goal, LIGHT.before, LIGHT.after)))
_CHANGED = {ONE_LINK: "--", ONE_CLIENT: ":"}


def growth_figure(points: Sequence[Point], path: Path) -> None:
    """Draw the points of the near network, and the ideal line; path ends in .png, .svg or .pdf."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    agents = list(dict.fromkeys(one.agent for one in points))
    figure = Figure(figsize=(8.6, 4.3), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(agents), squeeze=False)[0]
    for axes, agent in zip(panels, agents):
        near = [one for one in points if one.agent == agent and one.latency_s == NEAR]
        most = [one for one in near if one.directions == max(DIRECTIONS)]
        ideal = sorted({(one.simulators, one.ideal) for one in most})
        axes.plot(*zip(*ideal), color=LIGHT.muted, linewidth=1.0, label="ideal")
        for tuner, style in _CHANGED.items():
            chosen = [one for one in most if one.tuner == tuner]
            _line(axes, chosen, style, _COLOURS[max(DIRECTIONS)], f"{max(DIRECTIONS)}, {tuner}")
        for directions, colour in reversed(_COLOURS.items()):
            chosen = [one for one in near if one.directions == directions and one.tuner == AS_IT_IS]
            _line(axes, chosen, "o-", colour, f"{directions} directions")
        axes.set_xscale("log", base=2)
        axes.set_yscale("log")
        places = sorted({one.simulators for one in near})[::2]
        axes.set_xticks(places, [str(place) for place in places])
        axes.set_title(agent)
        axes.set_xlabel("simulators [number]")
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("rollouts a second [1/s]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, frameon=False, fontsize=9)
    save_figure(figure, path)


def _line(axes: Axes, points: Sequence[Point], style: str, colour: str, label: str) -> None:
    values = [one.rollouts_per_second for one in points]
    axes.plot([one.simulators for one in points], values, style, color=colour, linewidth=1.4, markersize=3, label=label)
