"""One environment behind five methods, the same episode for the same seed and actions."""

from __future__ import annotations

import importlib
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drs_core.environments.catalogue import Entry, current_name, entry
from drs_core.environments.fast import stepper
from drs_core.environments.light_import import without_scipy
from drs_core.environments.memory import give_back
from drs_core.environments.quiet import quiet
from drs_core.environments.repeatable import CURES
from drs_core.errors import DrsError, UsageError, install

DEFAULT_TIME_LIMIT_STEPS = 1000
"""For ids that set no time limit: a search needs every episode to end."""

_ID = re.compile(r"[A-Za-z0-9_.\-/]{1,100}")

Observation = NDArray[np.floating] | dict[str, NDArray[np.floating]]


@dataclass(frozen=True)
class Spaces:
    """What an environment gives and takes.

    Attributes:
        parts: size of every part of the observation; the key is ``observation`` for a plain Box.
        is_dict: whether observations are dicts.
        low, high: (n_actions,) float32, the action bounds.
        time_limit_steps: an episode's greatest length.
    """

    parts: dict[str, int]
    is_dict: bool
    low: NDArray[np.float32]
    high: NDArray[np.float32]
    time_limit_steps: int


class Step(NamedTuple):
    """What one step gave; success is None where the environment does not define it."""

    observation: Observation
    reward: float
    terminated: bool
    truncated: bool
    success: bool | None


class Environment:
    """A gymnasium environment made ready for exact repeatability."""

    def __init__(self, environment_id: str, fast: bool = True, visible: bool = False) -> None:
        """Make the environment of this id, old ids included.

        Args:
            environment_id: of gymnasium.
            fast: step faster where that gives the same bits (PyBullet's eight); False: upstream's own step.
            visible: with all that a camera needs (`drs_core.environments.camera`); the same episodes.

        Raises:
            UsageError: the id is unknown, or its spaces are not Box (or Dict of Box) and Box.
            DrsError: the package that it needs is not installed.
        """
        if not _ID.fullmatch(environment_id):
            # gymnasium would import the module named before a colon
            raise UsageError(f"{environment_id[:100]!r} is not an environment id: letters, digits and _ . - / only.")
        self.id = current_name(environment_id)
        self._entry = entry(self.id)
        self._env, self.spaces = _make(self.id, self._entry, visible)
        # the twelve run bare: the wrappers cost time, and their time limit is counted here
        self._exact = self._entry.family in CURES
        self._runs_on = self._entry.family.startswith("panda")
        if self._exact:
            self._env = self._env.unwrapped
            with quiet():
                self._before_reset = CURES[self._entry.family](self._env)
        quick = stepper(self.id, self._env) if fast else None
        self.is_fast = quick is not None
        self._take = quick or self._env.step
        self._dtypes = _dtypes(self._env.observation_space)
        self._steps = 0

    @property
    def unwrapped(self) -> Any:
        """The bare upstream environment."""
        return self._env.unwrapped

    def reset(self, seed: int) -> Observation:
        """Begin the episode of this seed."""
        if self._exact:
            self._before_reset()
        self._steps = 0
        observation, _ = self._env.reset(seed=seed)
        return self._cast(observation)

    def step(self, action: NDArray[np.float32]) -> Step:
        """Take one step with action (n_actions,) float32."""
        observation, reward, terminated, truncated, info = self._take(action)
        self._steps += 1
        success = self._entry.success(bool(terminated), float(reward), info)
        if self._runs_on:
            # panda-gym 3 ends an episode at the first success; shaking shows only after it
            terminated = False
        truncated = bool(truncated) or self._steps >= self.spaces.time_limit_steps
        # a fast step gives the space's types itself
        seen = observation if self.is_fast else self._cast(observation)
        return Step(seen, float(reward), bool(terminated), truncated, success)

    def close(self) -> None:
        """Free the simulator, and its memory."""
        self._env.close()
        give_back()

    def _cast(self, observation: Any) -> Observation:
        if isinstance(observation, dict):
            return {key: np.asarray(observation[key], dtype=dtype) for key, dtype in self._dtypes.items()}
        return np.asarray(observation, dtype=self._dtypes[""])


def describe(environment_id: str) -> Spaces:
    """The spaces of an environment, by making it once."""
    environment = Environment(environment_id, fast=False)
    environment.close()
    return environment.spaces


def _make(environment_id: str, known: Entry, visible: bool) -> tuple[Any, Spaces]:
    try:
        import gymnasium
    except ModuleNotFoundError as error:
        raise DrsError(f"{environment_id} needs gymnasium; {install('sim')}.") from error
    try:
        with quiet():
            if known.package:
                with without_scipy():
                    importlib.import_module(known.package)
            # PyBullet has a camera of its own
            mode = {"render_mode": "rgb_array"} if visible and not known.package else {}
            with warnings.catch_warnings(), _without_meshes(known, visible):
                warnings.simplefilter("ignore")
                env = gymnasium.make(environment_id, disable_env_checker=True, **mode)
    except ModuleNotFoundError as error:
        mend = install("sim") if known.package else f"install it with: pip install {error.name}"
        raise DrsError(f"{environment_id} needs {error.name}; {mend}.") from error
    except gymnasium.error.DependencyNotInstalled as error:
        raise DrsError(f"{environment_id} cannot be made: {_first_line(error)}") from error
    except gymnasium.error.Error as error:
        raise UsageError(f"There is no environment {environment_id!r}: {_first_line(error)}") from error
    except Exception as error:  # an environment's constructor may fail in any way
        raise UsageError(f"{environment_id} cannot be made: {_first_line(error)}") from error
    return env, _spaces(environment_id, env)


def _first_line(error: Exception) -> str:
    return str(error).strip().splitlines()[0][:200] if str(error).strip() else type(error).__name__


@contextmanager
def _without_meshes(known: Entry, visible: bool) -> Iterator[None]:
    """Panda without the meshes that only a renderer needs: 60 MB less, the same motion bit for bit."""
    if visible or not known.family.startswith("panda"):
        yield
        return
    import pybullet
    from panda_gym.pybullet import PyBullet

    load = PyBullet.loadURDF

    def load_without(simulation: Any, body_name: str, **arguments: Any) -> None:
        flags = arguments.pop("flags", 0) | pybullet.URDF_IGNORE_VISUAL_SHAPES
        load(simulation, body_name, flags=flags, **arguments)

    PyBullet.loadURDF = load_without
    try:
        yield
    finally:
        PyBullet.loadURDF = load


def _spaces(environment_id: str, env: Any) -> Spaces:
    from gymnasium import spaces

    action, observation = env.action_space, env.observation_space
    if not isinstance(action, spaces.Box) or len(action.shape) != 1:
        raise UsageError(f"{environment_id} has actions {action}; only a Box of one dimension works.")
    if not (np.isfinite(action.low).all() and np.isfinite(action.high).all()):
        raise UsageError(f"{environment_id} has unbounded actions {action}; the bounds must be finite.")
    is_dict = isinstance(observation, spaces.Dict)
    boxes = dict(observation.spaces) if is_dict else {"observation": observation}
    for key, box in boxes.items():
        if not isinstance(box, spaces.Box) or len(box.shape) != 1:
            raise UsageError(f"{environment_id} observes {key!r} as {box}; only Boxes of one dimension work.")
    limit = env.spec.max_episode_steps if env.spec else None
    return Spaces(
        # in the order of the space, as Stable-Baselines3 concatenates them; gymnasium sorts plain dicts itself
        parts={key: int(box.shape[0]) for key, box in boxes.items()},
        is_dict=is_dict,
        low=action.low.astype(np.float32),
        high=action.high.astype(np.float32),
        time_limit_steps=limit or DEFAULT_TIME_LIMIT_STEPS,
    )


def _dtypes(space: Any) -> dict[str, Any]:
    boxes = space.spaces if hasattr(space, "spaces") else {"": space}
    return {key: box.dtype for key, box in boxes.items()}
