"""The twelve environments of the paper, exactly repeatable, and any other gymnasium id."""

from drs_core.environments.catalogue import PAPER, current_name
from drs_core.environments.environment import Environment, Spaces, Step, describe
from drs_core.environments.fast import is_proved
from drs_core.environments.quiet import quiet, redirected
from drs_core.environments.timing import Timing, timing

__all__ = [
    "PAPER",
    "Environment",
    "Spaces",
    "Step",
    "Timing",
    "current_name",
    "describe",
    "is_proved",
    "quiet",
    "redirected",
    "timing",
]
