"""An environment as gymnasium makes it, for programs that bring their own wrappers."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium

from drs_core.environments.environment import Environment
from drs_core.environments.quiet import quiet


class RunOn(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Panda runs to its time limit, as in the paper: panda-gym 3 ends an episode at the first success."""

    def step(self, action: Any) -> Any:
        """One step that never terminates."""
        observation, reward, _, truncated, info = self.env.step(action)
        return observation, reward, False, truncated, info


def upstream(environment_id: str) -> Any:
    """The environment without gymnasium's checker; Panda to its time limit."""
    Environment(environment_id).close()  # registers the id
    with quiet(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        env = gymnasium.make(environment_id, disable_env_checker=True)
    return RunOn(env) if environment_id.startswith("Panda") else env
