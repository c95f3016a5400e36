"""The same steps as upstream's, bit for bit, with fewer calls of PyBullet and without small arrays."""

from drs_core.environments.fast.proved import Stepper, stepper

__all__ = ["Stepper", "stepper"]
