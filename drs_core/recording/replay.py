"""Show an agent what another one saw in a recording: would it have acted in the same way?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.actor import Actor
from drs_core.agent import Agent
from drs_core.errors import UsageError
from drs_core.recording.steps import AnsweredSteps

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Replay:
    """What was done, and what the agent would have done.

    Attributes:
        topic: of the observations.
        times_s: (n,) since the first, as recorded.
        recorded, replayed: (n, n_actions) float32.
        unanswered: observations without a recorded action.
        complete: whether the recording has its end.
    """

    topic: str
    times_s: Float64
    recorded: Float32
    replayed: Float32
    unanswered: int
    complete: bool


def replay(path: Path, agent: Agent, topic: str | None = None) -> Replay:
    """Feed the observations of an MCAP file to an agent.

    Args:
        path: of the file.
        agent: to be asked.
        topic: of the observations; None: the only one with actions beside it.

    Raises:
        UsageError: the recording is damaged, of another environment, or has no observations with actions.
    """
    actor = Actor(agent)
    steps = AnsweredSteps(path, actor, topic)
    times, recorded, replayed = [], [], []
    for seen, action in steps:
        times.append(1e-9 * seen.received_ns)
        recorded.append(action)
        replayed.append(actor.act(seen.parts, seen.step).copy())
    if not times:
        raise UsageError(f"{path} has no action that answers an observation on {steps.topic}.")
    moments = np.array(times)
    return Replay(
        steps.topic,
        moments - moments[0],
        np.array(recorded),
        np.array(replayed),
        steps.unanswered,
        steps.complete,
    )


def summary(result: Replay) -> dict[str, Any]:
    """Figures of a replay, as JSON has them; differences in the unit of the action."""
    difference = np.abs(result.replayed.astype(np.float64) - result.recorded)
    return {
        "topic": result.topic,
        "actions": len(difference),
        "equal": int((result.replayed == result.recorded).all(axis=1).sum()),
        "unanswered": result.unanswered,
        "complete": result.complete,
        "difference_mean": float(difference.mean()),
        "difference_max": float(difference.max()),
        "difference_max_at_s": float(result.times_s[difference.max(axis=1).argmax()]),
        "difference_mean_by_action": difference.mean(axis=0).tolist(),
        "difference_max_by_action": difference.max(axis=0).tolist(),
        "action_change_recorded": _change(result.recorded),
        "action_change_replayed": _change(result.replayed),
    }


def _change(actions: Float32) -> float | None:
    """Mean |a_t - a_(t-1)| over consecutive answers, those across two episodes included."""
    return float(np.abs(np.diff(actions.astype(np.float64), axis=0)).mean()) if len(actions) > 1 else None
