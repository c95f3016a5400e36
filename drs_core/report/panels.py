"""Which figures a page shows, each with its caption and its description in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from drs_core import backing_off
from drs_core.evaluation import Value
from drs_core.report import figures
from drs_core.report.gather import Findings
from drs_core.report.svg import inline_svg
from drs_core.reporting.colours import THEMED
from drs_core.reporting.figures import QUANTITIES

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Panel:
    """One figure as an ``<svg>`` element, and its caption."""

    svg: str
    caption: str
    side: str = ""


def _panel(figure: Figure, name: str, caption: str, described: str | None = None, side: str = "") -> Panel:
    return Panel(inline_svg(figure, name, described or caption), caption, side)


_MANY = 20
"""Fewer different returns than this would lie upon each other as dots."""


def tip_panels(findings: Findings) -> list[Panel]:
    """The paper's figure: position and velocity, before and after; nothing where no tip was recorded."""
    shown = {side.label: side.shown[0] for side in findings.sides}
    if any(episode.tip_position is None for episode in shown.values()):
        return []
    panels = []
    for quantity in QUANTITIES:
        limits = figures.common_limits(list(shown.values()), quantity)
        for label, episode in shown.items():
            figure = figures.tip_over_time(episode, quantity, limits, THEMED)
            described = f"Tip {quantity} over time {label} tuning: from {limits[0]:.2g} to {limits[1]:.2g}."
            panels.append(_panel(figure, f"tip-{quantity}-{label}", f"tip {quantity}", described, label))
    return panels


def space_panels(findings: Findings) -> list[Panel]:
    """Tip paths in space, jitter in the goal region, and every seed's speed there."""
    shown = {side.label: side.shown[0] for side in findings.sides}
    if any(episode.tip_position is None for episode in shown.values()):
        return []
    panels = [
        _panel(
            figures.tip_paths(shown, findings.goal, THEMED),
            "paths",
            "The tip's path in space, a dot every 0.04 s; each axis has its own scale.",
        ),
        _panel(
            figures.jitter(shown, THEMED),
            "jitter",
            "Jitter: the tip in the second half of the episode, seen from above, about its own mean.",
        ),
    ]
    if findings.after:
        for name, unit, what, value in _MOTIONS:
            before, after = (side.evaluation.column(value) for side in findings.sides)
            panels.append(
                _panel(
                    figures.pairs(before, after, f"{name} [{unit}]", "log", THEMED),
                    name.replace(" ", "-"),
                    f"{what} in the goal region, a dot for each of {len(before)} seeds; {_below(before, after)}",
                )
            )
    return panels


_MOTIONS: tuple[tuple[str, str, str, Value], ...] = (
    ("tip speed", "m/s", "Mean tip speed", lambda episode: episode.motion.speed_mean if episode.motion else 0.0),
    ("jerk²", "m²/s⁶", "Mean squared jerk", lambda episode: episode.motion.jerk_mean_square if episode.motion else 0.0),
)


def _below(before: NDArray[np.float64], after: NDArray[np.float64]) -> str:
    return f"{int((after < before).sum())} lie below the line of no change, {int((after > before).sum())} above."


_DISTRIBUTIONS: tuple[tuple[str, str, str, Value], ...] = (
    ("return", "return", "Return", lambda episode: episode.return_),
    ("length", "length [steps]", "Length of an episode", lambda episode: float(episode.length)),
    (
        "dimension",
        "mesh dimension",
        "Mesh dimension of what the policy sees",
        lambda episode: episode.dimension.mean() if episode.dimension else float("nan"),
    ),
)


def distribution_panels(findings: Findings) -> tuple[list[Panel], list[str]]:
    """Histograms, and a sentence for what is the same in every episode."""
    panels, sentences = [], []
    for name, label, title, value in _DISTRIBUTIONS:
        values = {side.label: side.evaluation.column(value) for side in findings.sides}
        values = {side: column[np.isfinite(column)] for side, column in values.items()}
        if any(not len(column) for column in values.values()):
            continue
        everything = np.concatenate(list(values.values()))
        if np.ptp(everything) == 0.0:
            sentences.append(f"{title} is {everything[0]:g} in every episode.")
            continue
        means = ", ".join(f"{side} mean {column.mean():.4g}" for side, column in values.items())
        caption = f"{title}; vertical lines at the means."
        panels.append(_panel(figures.distribution(values, label, THEMED), name, caption, f"{title}: {means}."))
        if name == "return" and len(values) > 1 and len(np.unique(everything)) > _MANY:
            before, after = values.values()
            caption = f"Return, a dot for each of {len(before)} seeds; {_below(before, after)}"
            panels.append(_panel(figures.pairs(before, after, label, palette=THEMED), "return-pairs", caption))
    return panels, sentences


def curve_panels(findings: Findings) -> list[Panel]:
    """Learning curves and schedule; nothing before the first update."""
    return list(_curves(findings)) if findings.history else []


def _curves(findings: Findings) -> Iterator[Panel]:
    evaluations = [record for record in findings.run.evaluations if record["update"] <= findings.done]
    name = findings.run.config.objective.name
    keys = {"objective": f"The objective, {name}"} if name != "return" else {}
    for key, what in {**keys, "return": "The return"}.items():
        figure = figures.learning_curve(findings.history, evaluations, key, THEMED)
        caption = f"{what}, by update: mean and standard deviation of its perturbed rollouts"
        caption += "; dots: the unperturbed agent" if evaluations else ""
        caption += "; dotted lines: back to the best agent." if backing_off.places(findings.history) else "."
        yield _panel(figure, f"curve-{key}", caption)
    yield _panel(
        figures.schedule(findings.history, THEMED), "schedule", "Step size alpha and perturbation sigma of each update."
    )
    if keys:
        yield _panel(figures.step_lengths(findings.history, THEMED), "steps", "How far each update moved theta.")
