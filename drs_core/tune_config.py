"""Everything that decides a run's result, checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from drs_core import backing_off
from drs_core.accelerator import PLAIN, PYTHON, check_backend
from drs_core.errors import UsageError
from drs_core.objective import Objective
from drs_core.rollouts import ATTEMPTS
from drs_core.rollouts.attempts import MAX_ATTEMPTS
from drs_core.search import SearchConfig


@dataclass(frozen=True)
class TuneConfig:
    """Everything that decides a run's result.

    Attributes:
        search: settings of the search.
        objective: what it maximises.
        evaluate_every: updates between evaluations on seeds of their own; 0 for none.
        evaluation_episodes: episodes of one evaluation.
        backend: what runs every episode; `compiled` rounds differently, so a run keeps to it or to the others.
        attempts: how often at most a pair of which an episode was broken off is run, before it is dropped.
        action_change_max: no perturbation changes an action by more on recorded observations [unit of the
            action]: sigma is lowered where it would; 0 for no such cap.
        back_off: where the search's episodes are clearly worse than its start's, or than they were, it goes on from
            the best agent with more careful steps.
    """

    search: SearchConfig = field(default_factory=SearchConfig)
    objective: Objective = field(default_factory=Objective)
    evaluate_every: int = 10
    evaluation_episodes: int = 20
    backend: str = "python"
    attempts: int = ATTEMPTS
    action_change_max: float = 0.0
    back_off: bool = False

    def __post_init__(self) -> None:
        """Raise UsageError with the name, value and range of a setting that is not allowed."""
        for name, least in (("evaluate_every", 0), ("evaluation_episodes", 1)):
            value = getattr(self, name)
            if not least <= value <= 1_000_000:
                raise UsageError(f"{name} is {value}; allowed are {least} to 1000000.")
        check_backend(self.backend)
        if not 1 <= self.attempts <= MAX_ATTEMPTS:
            raise UsageError(f"attempts is {self.attempts}; allowed are 1 to {MAX_ATTEMPTS}.")
        if not 0.0 <= self.action_change_max <= 1e6:
            raise UsageError(f"action_change_max is {self.action_change_max}; allowed are 0 (no cap) to 1e6.")
        backing_off.check(self.back_off, self.evaluate_every)

    def flat(self) -> dict[str, Any]:
        """One mapping of plain values, under the names that parameter files use."""
        return {
            **asdict(self.search),
            "objective": self.objective.name,
            "smoothness_weight": self.objective.smoothness_weight,
            "evaluate_every": self.evaluate_every,
            "evaluation_episodes": self.evaluation_episodes,
            # plain stepping gives the same episodes
            "backend": PYTHON if self.backend == PLAIN else self.backend,
            "attempts": self.attempts,
            "action_change_max": self.action_change_max,
            "back_off": self.back_off,
        }


MOST_WEIGHT = 1e9
"""Of the objective `smooth`, where it is given: objectives have to stay finite, and their squares too."""
SHORT_SCHEDULE: dict[str, tuple[float, float]] = {"alpha": (0.02, 0.01), "sigma": (0.025, 0.0125)}
"""Of `smooth`, unless told otherwise: its runs are short, and to end at a tenth leaves some goals shaking."""

GAINS_SCHEDULE: dict[str, tuple[float, float]] = {"alpha": (0.1, 0.05), "sigma": (0.15, 0.075)}
"""Of `action_gains`, unless told otherwise: both are parts of a gain, which half of it hardly breaks."""


def tune_config(values: Mapping[str, Any]) -> TuneConfig:
    """A configuration from parameters by name, as files and options give them; the others have defaults.

    Raises:
        UsageError: a value is out of range.
    """
    # to ROS a parameter that is not set is 0, so 0 means the same here
    weight = values.get("smoothness_weight") or None
    if weight is not None and weight > MOST_WEIGHT:
        raise UsageError(f"smoothness_weight is {weight:g}; allowed are 0 (the agent's own) to {MOST_WEIGHT:g}.")
    objective = Objective(values.get("objective", "return"), weight)
    if weight is not None and objective.name != "smooth":
        raise UsageError(
            f"smoothness_weight is {weight:g}, and the objective {objective.name} has no weight; "
            "leave it out, or take the objective smooth."
        )
    schedule = SHORT_SCHEDULE if objective.name == "smooth" else {}
    known = (GAINS_SCHEDULE if values.get("action_gains") else schedule) | dict(values)
    search = SearchConfig(**{field.name: known[field.name] for field in fields(SearchConfig) if field.name in known})
    own = ("evaluate_every", "evaluation_episodes", "backend", "attempts", "action_change_max", "back_off")
    rest = {name: values[name] for name in own if name in values}
    return TuneConfig(search, objective, **rest)
