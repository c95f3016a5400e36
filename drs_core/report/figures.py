"""Figures of a run, a panel each: plain matplotlib, for a page (palette THEMED) or any file (LIGHT).

For a file: ``learning_curve(history, evaluations, "return").savefig("curve.png", facecolor="white")``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from drs_core import backing_off
from drs_core.episode import Episode
from drs_core.report.run import Record
from drs_core.reporting.colours import LIGHT, Palette
from drs_core.reporting.figures import QUANTITIES, draw_tip

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE_IN = (4.7, 3.1)
"""A panel that is legible at the width of a phone."""
_BINS = 24
_SMALLEST = 1e-6
"""On logarithmic axes, where a value may be 0."""

Values = NDArray[np.float64]


def learning_curve(
    history: Sequence[Record], evaluations: Sequence[Record], key: str, palette: Palette = LIGHT
) -> Figure:
    """Mean of ``objective`` or ``return`` of an update's perturbed rollouts, their spread, and the evaluations.

    A vertical line where the run went back to its best agent.
    """
    figure, axes = _panel(palette, "update", key)
    updates = [record["update"] for record in history]
    mean, std = (np.array([record[f"{key}_{moment}"] for record in history]) for moment in ("mean", "std"))
    axes.fill_between(updates, mean - std, mean + std, color=palette.muted, alpha=0.18, linewidth=0)
    axes.plot(updates, mean, "o-", color=palette.muted, linewidth=1.6, markersize=3, label="perturbed rollouts")
    if evaluations:
        at = [record["update"] for record in evaluations]
        axes.errorbar(
            at,
            [record[f"{key}_mean"] for record in evaluations],
            [record[f"{key}_std"] for record in evaluations],
            fmt="o",
            color=palette.after,
            capsize=3,
            label="the agent itself",
        )
    for update in backing_off.places(history):
        axes.axvline(update - 0.5, color=palette.axes[2], linewidth=1.2, linestyle=":")
    _whole_numbers(axes)
    _legend(figure, axes, palette)
    return figure


def schedule(history: Sequence[Record], palette: Palette = LIGHT) -> Figure:
    """Step size alpha and perturbation sigma of every update."""
    figure, axes = _panel(palette, "update", "alpha, sigma")
    updates = [record["update"] for record in history]
    for key, colour, style in (("sigma", palette.axes[1], "o-"), ("alpha", palette.axes[2], "o--")):
        values = [record[key] for record in history]
        axes.plot(updates, values, style, color=colour, linewidth=1.8, markersize=3, label=key)
    axes.set_ylim(bottom=0.0)
    _whole_numbers(axes)
    _legend(figure, axes, palette)
    return figure


def step_lengths(history: Sequence[Record], palette: Palette = LIGHT) -> Figure:
    """How far each update moved theta."""
    figure, axes = _panel(palette, "update", "length of the step in theta")
    updates, lengths = ([record[key] for record in history] for key in ("update", "step_norm"))
    axes.plot(updates, lengths, "o-", color=palette.muted, linewidth=1.8, markersize=3)
    axes.set_ylim(bottom=0.0)
    _whole_numbers(axes)
    return figure


def distribution(values: dict[str, Values], label: str, palette: Palette = LIGHT) -> Figure:
    """Histograms of ``before`` and ``after`` over common bins; a line at each mean."""
    figure, axes = _panel(palette, label, "episodes")
    everything = np.concatenate(list(values.values()))
    edges = np.histogram_bin_edges(everything, _bins(everything)).tolist()
    for side, found in values.items():
        colour = palette.side(side)
        axes.hist(found, edges, histtype="stepfilled", color=colour, alpha=0.28, label=side)
        axes.hist(found, edges, histtype="step", color=colour, linewidth=1.6)
        axes.axvline(found.mean(), color=colour, linewidth=1.6, linestyle="-" if side == "before" else "--")
    _legend(figure, axes, palette)
    return figure


def pairs(before: Values, after: Values, label: str, scale: str = "linear", palette: Palette = LIGHT) -> Figure:
    """A dot for every seed, before against after, and the line of no change; scale may be ``log``."""
    figure, axes = _panel(palette, f"before: {label}", f"after: {label}")
    x, y = (np.maximum(values, _SMALLEST) if scale == "log" else values for values in (before, after))
    ends = [min(x.min(), y.min()), max(x.max(), y.max())]
    axes.plot(ends, ends, color=palette.muted, linewidth=1.2)
    axes.plot(x, y, "o", color=palette.after, markersize=4, alpha=0.7, markeredgewidth=0)
    axes.set(xscale=scale, yscale=scale)
    return figure


def tip_over_time(episode: Episode, quantity: str, limits: tuple[float, float], palette: Palette = LIGHT) -> Figure:
    """The tip's ``position`` or ``velocity`` in one episode."""
    figure, axes = _panel(palette, "time [s]", QUANTITIES[quantity])
    draw_tip(axes, episode, quantity, palette)
    axes.set_ylim(limits)
    _legend(figure, axes, palette)
    return figure


def common_limits(episodes: Sequence[Episode], quantity: str) -> tuple[float, float]:
    """The range that holds this quantity of all episodes, with a margin."""
    series = [getattr(episode, f"tip_{quantity}") for episode in episodes]
    low, high = min(float(each.min()) for each in series), max(float(each.max()) for each in series)
    margin = 0.05 * (high - low) or 0.01
    return low - margin, high + margin


def jitter(episodes: dict[str, Episode], palette: Palette = LIGHT) -> Figure:
    """The tip's path in the goal region (second half of the episode) about its own mean, in mm, from above."""
    figure, axes = _panel(palette, "x about its mean [mm]", "y about its mean [mm]")
    for side, episode in episodes.items():
        path = _positions(episode)[max(episode.length // 2 - 1, 0) :, :2]
        about = 1e3 * (path - path.mean(axis=0))
        axes.plot(about[:, 0], about[:, 1], "o-", color=palette.side(side), markersize=3, linewidth=1.1, label=side)
    axes.set_aspect("equal", adjustable="datalim")
    _legend(figure, axes, palette)
    return figure


def tip_paths(episodes: dict[str, Episode], goal: Values | None, palette: Palette = LIGHT) -> Figure:
    """The tip's path in space, and the goal."""
    figure = _figure()
    axes: Any = figure.add_subplot(projection="3d", computed_zorder=False, facecolor="none")
    for place, (side, episode) in enumerate(episodes.items()):
        path = _positions(episode)
        style = {"color": palette.side(side), "linewidth": 1.4, "zorder": 3 + place, "label": side}
        axes.plot(path[:, 0], path[:, 1], path[:, 2], marker="o", markersize=1.8, **style)
    if goal is not None:
        star = {"markersize": 15, "markerfacecolor": "none", "markeredgewidth": 1.8, "zorder": 9}
        axes.plot(*goal[:, None], "*", color=palette.goal, label="goal", linestyle="none", **star)
    for which, axis in zip("xyz", (axes.xaxis, axes.yaxis, axes.zaxis), strict=True):
        axis.set_pane_color((0.0, 0.0, 0.0, 0.0))
        axis.line.set_color(palette.muted)
        axis._axinfo["grid"].update(color=palette.grid, linewidth=0.8)
        axis.set_label_text(f"{which} [m]", color=palette.foreground)
        axis.set_major_locator(_few_ticks())
        axes.tick_params(which, colors=palette.muted, labelsize=8, pad=-1)
    axes.view_init(elev=22, azim=-58)
    axes.set_box_aspect((1, 1, 0.8), zoom=0.96)
    _legend(figure, axes, palette)
    return figure


def _positions(episode: Episode) -> NDArray[np.float32]:
    if episode.tip_position is None:
        raise ValueError("the episode was run without recording its tip")
    return episode.tip_position


def _figure() -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE_IN, layout="constrained", facecolor="none")
    FigureCanvasAgg(figure)
    return figure


def _panel(palette: Palette, x_label: str, y_label: str) -> tuple[Figure, Axes]:
    figure = _figure()
    axes = figure.subplots()
    axes.set_facecolor("none")
    axes.set_xlabel(x_label, color=palette.foreground)
    axes.set_ylabel(y_label, color=palette.foreground)
    axes.tick_params(which="both", colors=palette.muted, labelcolor=palette.foreground)
    axes.grid(color=palette.grid, linewidth=0.8)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(palette.muted)
    return figure, axes


def _legend(figure: Figure, axes: Any, palette: Palette) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper left", ncols=4, frameon=False, labelcolor=palette.foreground,
        handlelength=1.4, columnspacing=1.2, borderpad=0.0,
    )  # fmt: skip


def _whole_numbers(axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def _few_ticks() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(3)


def _bins(values: Values) -> Any:
    distinct = np.unique(values)
    if len(distinct) <= _BINS and (distinct == np.round(distinct)).all() and np.ptp(distinct) <= _BINS:
        # a bar for each whole number, as PandaReach's returns are
        return np.arange(distinct[0] - 0.5, distinct[-1] + 1.0)
    return _BINS
