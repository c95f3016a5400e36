"""What to train, checked where it is made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from drs_core.errors import UsageError, shown
from drs_core.training.recipes import Recipe, recipe
from drs_core.training.settings import check_settings

WHEN_TO_END = ("steps", "stop_at_success")
"""Settings that a resumed training may change, because they only say when it is over."""


@dataclass(frozen=True)
class TrainConfig:
    """What to train; None where the recipe decides.

    Attributes:
        algorithm: one of the six.
        environment: gymnasium id.
        steps: environment steps, at most.
        seed: of everything.
        hidden: units of the hidden layers.
        time_feature: whether the policy observes the remaining time.
        teacher: whether a scripted controller acts while the training warms up.
        evaluate_every: steps between evaluations.
        episodes: episodes of an evaluation that may make an agent the best.
        stop_at_success: end at the first such evaluation with this success in percent.
        settings: keyword arguments of the algorithm, over those of the recipe.
    """

    algorithm: str
    environment: str
    steps: int | None = None
    seed: int = 0
    hidden: tuple[int, ...] | None = None
    time_feature: bool | None = None
    teacher: bool | None = None
    evaluate_every: int | None = None
    episodes: int | None = None
    stop_at_success: float | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Raise UsageError with the name, value and range of a setting that is not allowed."""
        for name, value in (
            ("steps", self.steps),
            ("evaluate_every", self.evaluate_every),
            ("episodes", self.episodes),
        ):
            if value is not None and not 1 <= value <= 10**9:
                raise UsageError(f"{name} is {value}; allowed are 1 to 1e9.")
        if self.hidden is not None and not (self.hidden and all(1 <= units <= 4096 for units in self.hidden)):
            raise UsageError(f"hidden is {shown(self.hidden)}; allowed are one or more layers of 1 to 4096 units.")
        if not 0 <= self.seed < 2**31:
            raise UsageError(f"seed is {self.seed}; allowed are 0 to 2^31 - 1.")
        if self.stop_at_success is not None and not 0.0 < self.stop_at_success <= 100.0:
            raise UsageError(f"stop_at_success is {self.stop_at_success}; allowed are more than 0, to 100 percent.")
        check_settings(self.settings)

    def recipe(self) -> Recipe:
        """The recipe with what this configuration decides."""
        chosen = recipe(self.algorithm, self.environment, self.teacher)
        names = ("steps", "hidden", "time_feature", "evaluate_every", "episodes")
        given = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        return replace(chosen, **given, settings=chosen.settings | dict(self.settings))

    def record(self) -> dict[str, Any]:
        """Everything that decides the result, as JSON has it."""
        everything = asdict(self.recipe())
        return {
            "algorithm": self.algorithm,
            "environment": self.environment,
            "seed": self.seed,
            "stop_at_success": self.stop_at_success,
            **everything,
            "hidden": list(everything["hidden"]),
        }
