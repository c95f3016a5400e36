"""Where a run's episodes are run: in processes of this machine, or on a Ray cluster."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from drs_core.errors import UsageError
from drs_core.options import worker_count

if TYPE_CHECKING:
    from drs_core.agent import Agent
    from drs_core.rollouts import Rollouts

MakeRollouts = Callable[["Agent", str], "Rollouts"]
"""Agent, backend -> what runs the episodes."""


def chosen_place(place: str, ray: Path | None, workers: int | None) -> MakeRollouts:
    """What runs episodes at `place`, ``local`` or ``ray``.

    Raises:
        UsageError: there is no such place, or a setting is not for it.
        DrsError: Ray is not installed.
    """
    if place not in ("local", "ray"):
        raise UsageError(f"Rollouts {place!r} are not known; choose local or ray.")
    if ray is not None and place != "ray":
        raise UsageError(f"--ray {ray} is for --rollouts ray.")
    return _local(worker_count(workers)) if place == "local" else _on_ray(ray, workers)


def _local(workers: int) -> MakeRollouts:
    from drs_core.rollouts import local

    return lambda agent, backend: local(agent, workers, backend)


def _on_ray(settings: Path | None, workers: int | None) -> MakeRollouts:
    from drs_core.ray_rollouts import RayRollouts, read_ray_config

    config = read_ray_config(settings)
    if workers is not None:
        if config.address is not None:
            raise UsageError(f"{settings} names the cluster {config.address}, whose machines say how many workers.")
        if workers < 1:
            raise UsageError(f"workers is {workers}; on Ray it is 1 or more, or leave it out for all cores.")
        config = replace(config, cpus=workers)
    return lambda agent, backend: RayRollouts(agent, config, backend)
