"""Rollouts on a Ray cluster: the protocol `Rollouts` over machines that come and go."""

from drs_core.ray_rollouts.cluster import RayRollouts
from drs_core.ray_rollouts.config import RayConfig, read_ray_config

__all__ = ["RayConfig", "RayRollouts", "read_ray_config"]
