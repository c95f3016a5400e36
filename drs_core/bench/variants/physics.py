"""The physics alone: as many steps of the environment's own world as it takes itself, and nothing else.

After a reset one motor command is given and held. The world is reset now and then, which is not timed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from drs_core.agent import Agent
from drs_core.bench.sample import Sample, Stopwatch
from drs_core.bench.variants import Absent
from drs_core.environments import quiet
from drs_core.environments.upstream import upstream

_HELD = 0.3
"""Of the greatest action."""
_BEFORE_IT_RESTS = 100
"""Box2D: steps after which a body without commands may lie still, and cost nothing."""


class Physics:
    """Steps of the simulator with a held command."""

    def __init__(self, agent: Agent) -> None:
        """Make the plain environment.

        Raises:
            Absent: the environment has no physics engine.
        """
        name = agent.environment
        if name.startswith("MountainCar"):
            raise Absent("its dynamics are two lines of arithmetic, without a physics engine")
        self._env = upstream(name)
        self._step = _stepper(self._env.unwrapped)
        self._limit = (
            _BEFORE_IT_RESTS if name.startswith(("LunarLander", "Bipedal")) else self._env.spec.max_episode_steps
        )
        with quiet():
            self._env.reset(seed=0)

    def run(self, seed: int, steps: int) -> Sample:
        """Exactly `steps` environment steps' worth of physics."""
        step, left, watch = self._step, steps, Stopwatch()
        while left > 0:
            self._hold(seed)
            now = range(min(left, self._limit))
            with watch.running():
                for _ in now:
                    step()
            left -= len(now)
        return Sample(steps, 0, watch.cpu_s, watch.wall_s)

    def _hold(self, seed: int) -> None:
        env = self._env.unwrapped
        self._env.reset(seed=seed)
        space = env.action_space
        command = np.full(space.shape, _HELD, space.dtype) * space.high
        if hasattr(env, "scene"):  # locomotion: torques
            env.robot.apply_action(command)
        elif hasattr(env, "sim"):  # Panda: position targets
            env.robot.set_action(command)
        elif hasattr(env, "joints"):  # BipedalWalker: motor speeds; the lander has its engines off
            for joint in env.joints:
                joint.motorSpeed = _HELD

    def close(self) -> None:
        """Free the simulator."""
        self._env.close()


def _stepper(env: Any) -> Callable[[], Any]:
    """What an environment's step does to its world, without a Python layer in between."""
    import pybullet

    if hasattr(env, "sim"):
        return partial(_several, partial(pybullet.stepSimulation, env.sim.physics_client._client), env.sim.n_substeps)
    if hasattr(env, "robot"):
        # the scene, and its client, are made by the first reset
        with quiet():
            env.reset(seed=0)
        return partial(pybullet.stepSimulation, env._p._client)
    from gymnasium.envs.box2d.bipedal_walker import FPS

    # asked for through env: LunarLander makes a new world at every reset
    return lambda: env.world.Step(1.0 / FPS, 180, 60)


def _several(step: Callable[[], Any], times: int) -> None:
    for _ in range(times):
        step()
