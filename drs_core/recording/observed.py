"""What a policy saw in a recording, as a tuning run judges candidates on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from drs_core.actor import Actor
from drs_core.agent import Agent
from drs_core.errors import UsageError
from drs_core.observed import Thinned
from drs_core.policy import Float32
from drs_core.recording.steps import AnsweredSteps


def of_recording(path: Path, agent: Agent, topic: str | None = None) -> Float32:
    """The observations of an MCAP file, evenly thinned, as the agent's policy sees them.

    Args:
        path: of the file, as `drs record` writes it.
        agent: whose pipeline is applied.
        topic: of the observations; None: the only one with actions beside it.

    Returns:
        (at most MOST, n_features) float32.

    Raises:
        UsageError: the recording is damaged, of another environment, or has no observations with actions.
    """
    actor, thinned = Actor(agent), Thinned()
    steps = AnsweredSteps(path, actor, topic)
    for seen, _ in steps:
        features = actor.features(seen.parts, seen.step)
        if not np.isfinite(features).all():
            raise UsageError(f"{path} has an observation that no policy can use: its features are not finite.")
        thinned.add(features)
    rows = thinned.rows()
    if not len(rows):
        raise UsageError(f"{path} has no action that answers an observation on {steps.topic}.")
    return rows
