"""An actor that imitates a teacher first, while its critic learns; then the algorithm goes on alone.

Where one exact action decides an episode, a critic that has seen none of the policy's own leads the actor
astray before it could aim. So for a while the actor learns from the teacher alone: what it would do in
states of the replay buffer, the policy's own among them (DAgger: Ross, Gordon and Bagnell, 2011). The
critic learns as ever, of the actor as it is. The step size falls to 0 meanwhile: what is left of a
constant one is noise in the very action that decides.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.training.teachers.actions import Teacher

# of the imitating actor's exploration, before the squashing: as much as a strike bears
_SPREAD = 0.08
_STEPS, _BATCH = 4, 256


def imitating(algorithm: Any, teacher: Teacher, steps: int) -> Any:
    """The class of an off-policy algorithm whose actor imitates the teacher for the first `steps` steps."""
    import torch

    class Imitating(algorithm):
        def _setup_model(self) -> None:
            super()._setup_model()
            self.imitation = torch.optim.Adam(self.actor.parameters(), lr=self.lr_schedule(1))
            self._shown = _Shown(teacher, self.replay_buffer.buffer_size, self.action_space.shape[0])

        def _store_transition(self, replay_buffer: Any, *transition: Any) -> None:
            self._shown.forget(replay_buffer.pos)
            super()._store_transition(replay_buffer, *transition)

        def _get_torch_save_params(self) -> tuple[list[str], list[str]]:
            state_dicts, variables = super()._get_torch_save_params()
            return [*state_dicts, "imitation"], variables

        def _update_learning_rate(self, optimizers: Any) -> None:
            super()._update_learning_rate(optimizers)
            if self.num_timesteps <= steps:
                _set_step(self.actor.optimizer, 0.0)

        def train(self, gradient_steps: int, batch_size: int = 64) -> None:
            super().train(gradient_steps, batch_size)
            # the last step too, with size 0: an evaluation there is of the actor before the algorithm moves it
            if self.num_timesteps <= steps:
                left = (steps - self.num_timesteps) / (steps - self.learning_starts)
                _set_step(self.imitation, left * self.lr_schedule(1))
                for _ in range(_STEPS * gradient_steps):
                    self._imitate()

        def _imitate(self) -> None:
            # with the goals they were seen with: hindsight's are mostly where the puck lies, and teach no strike
            chosen = np.random.randint(self.replay_buffer.size(), size=_BATCH)
            raw = {name: rows[chosen, 0] for name, rows in self.replay_buffer.observations.items()}
            wanted = torch.from_numpy(self._shown(chosen, raw))
            normaliser = self.get_vec_normalize_env()
            seen = self.policy.obs_to_tensor(raw if normaliser is None else normaliser.normalize_obs(raw))[0]
            self.imitation.zero_grad()
            _unlike(self.actor, seen, wanted).backward()
            self.imitation.step()

    return Imitating


def _set_step(optimizer: Any, size: float) -> None:
    for group in optimizer.param_groups:
        group["lr"] = size


class _Shown:
    """What the teacher would do in each row of a replay buffer; it is asked once: asking takes longer than learning."""

    def __init__(self, teacher: Teacher, rows: int, actions: int) -> None:
        self._teacher, self._actions = teacher, np.full((rows, actions), np.nan, np.float32)

    def forget(self, row: int) -> None:
        """Of a row that something else will take."""
        self._actions[row] = np.nan

    def __call__(self, chosen: NDArray[np.int64], seen: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Its actions in the rows `chosen`, of which `seen` holds the observations."""
        for i, row in enumerate(chosen):
            if np.isnan(self._actions[row, 0]):
                self._actions[row] = self._teacher({name: values[i] for name, values in seen.items()})
        return self._actions[chosen]


def _unlike(actor: Any, seen: Any, wanted: Any) -> Any:
    """How unlike the teacher's actions an actor's are; SAC's and TQC's spread is led to `_SPREAD` with them.

    In absolute values: squares would make of "wait" and "strike" half a strike where either may be right.
    """
    if not hasattr(actor, "get_action_dist_params"):
        return (actor(seen) - wanted).abs().mean()
    mean, log_std, _ = actor.get_action_dist_params(seen)
    return (mean.tanh() - wanted).abs().mean() + (log_std - math.log(_SPREAD)).square().mean()
