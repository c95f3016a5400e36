"""Rollouts as tasks of a Ray cluster: theta goes out once an update, episodes in batches of half a second."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from drs_core.agent import Agent
from drs_core.episode import Episode
from drs_core.errors import DrsError, install
from drs_core.policy import Float32
from drs_core.ray_rollouts.batches import BatchSize
from drs_core.ray_rollouts.config import RayConfig
from drs_core.ray_rollouts.entry import worker_entry
from drs_core.ray_rollouts.failures import checked, explained, plain
from drs_core.ray_rollouts.messages import Answer, Batch
from drs_core.rollouts import Progress, Task
from drs_core.rollouts.proof import Proof

MOST_RETRIES = 10
"""A task whose worker or machine is lost is run again, with the same result; not for ever, since it may be to blame."""
_HERE = "local"
_LOOK_S = 1.0
_AHEAD = 2
"""Tasks handed out for each that runs, so that nobody waits for the next."""


class RayRollouts:
    """The protocol `Rollouts` over a Ray cluster. Use it as a context manager or call close()."""

    def __init__(self, agent: Agent, config: RayConfig | None = None, backend: str = "python") -> None:
        """Connect to the cluster, or start one.

        Raises:
            DrsError: Ray is not installed, or the cluster does not answer.
        """
        try:
            import ray
        except ModuleNotFoundError as error:
            raise DrsError(f"Rollouts on Ray need ray; {install('ray')}.") from error
        self._ray, self._config, self._backend = ray, config or RayConfig(), backend
        self._digest, self._batch = agent.digest(), BatchSize()
        self._ours = not ray.is_initialized()
        if self._ours:
            self._connect()
        try:
            self._agent = ray.put(agent)
            self._run_batch = ray.remote(
                num_cpus=self._config.cpus_per_task,
                resources=dict(self._config.resources) or None,
                max_retries=MOST_RETRIES,
            )(worker_entry())
        except BaseException:
            self.close()
            raise

    def run(self, theta: Float32, tasks: Sequence[Task], progress: Progress | None = None) -> list[Episode]:
        """Every task's episode, in the order of tasks.

        Raises:
            DrsError: an episode failed, its workers died again and again, a worker has another version of drs or
                draws other perturbations, or the cluster gives nothing.
        """
        ray, config = self._ray, self._config
        theta = np.ascontiguousarray(theta, dtype=np.float32)
        at, proof = ray.put(theta), Proof.of(theta)
        episodes: list[Episode | None] = [None] * len(tasks)
        given, done, under_way, heard_s = 0, 0, dict[Any, range](), time.monotonic()
        try:
            while done < len(tasks):
                slots = self._slots()
                while given < len(tasks) and len(under_way) < _AHEAD * slots:
                    some = range(given, given + self._batch.next(len(tasks) - given, slots))
                    batch = Batch(self._digest, self._backend, proof, [tasks[index] for index in some])
                    task = self._run_batch.remote([self._agent], batch.plain(), at)
                    under_way[task], given = some, some.stop
                ready, _ = ray.wait(list(under_way), timeout=_LOOK_S)
                if not ready and time.monotonic() - heard_s > config.patience_s:
                    wanted = {"CPU": config.cpus_per_task, **config.resources}
                    raise DrsError(
                        f"The cluster gave no result for {config.patience_s:g} s; a task takes {wanted}, "
                        f"the cluster has {self._resources()}."
                    )
                for task in ready:
                    heard_s, some = time.monotonic(), under_way.pop(task)
                    answer = self._answer(task, [tasks[index].seed for index in some])
                    episodes[some.start : some.stop] = answer.episodes
                    self._batch.learn(len(some), answer.duration_s)
                    done += len(some)
                    if progress:
                        progress(done)
        finally:
            for task in under_way:
                ray.cancel(task)
        return cast(list[Episode], episodes)

    def close(self) -> None:
        """Leave the cluster; one that was started here ends."""
        if self._ours:
            self._ray.shutdown()

    def __enter__(self) -> RayRollouts:
        """The rollouts themselves."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close them."""
        self.close()

    def _connect(self) -> None:
        config = self._config
        address = config.address or os.environ.get("RAY_ADDRESS") or _HERE
        ours: dict[str, Any] = {"num_cpus": config.cpus, "include_dashboard": False} if address == _HERE else {}
        try:
            self._ray.init(
                address=address,
                **ours,
                runtime_env=dict(config.runtime_env) or None,
                log_to_driver=False,
                logging_level="ERROR",
            )
        except (ConnectionError, RuntimeError, ValueError, OSError) as error:
            raise DrsError(f"Ray ({address}) does not answer: {plain(error)}") from error

    def _resources(self) -> dict[str, float]:
        known = self._ray.cluster_resources()
        return {name: value for name, value in known.items() if not name.startswith(("node:", "object_store"))}

    def _slots(self) -> int:
        """Tasks that the cluster can run at once, by the machines that it has now."""
        return max(int(self._ray.cluster_resources().get("CPU", 0.0) / self._config.cpus_per_task), 1)

    def _answer(self, task: Any, seeds: Sequence[int]) -> Answer:
        try:
            answer = self._ray.get(task)
        except self._ray.exceptions.RayError as error:
            raise DrsError(explained(error, self._ray.exceptions, MOST_RETRIES)) from error
        if isinstance(answer, str):
            raise DrsError(answer)
        return checked(answer, seeds)
