"""The same steps as upstream's, bit for bit, with fewer calls of PyBullet and without small arrays."""

from drs_core.environments.fast.proved import Stepper, is_proved, stepper

__all__ = ["Stepper", "is_proved", "stepper"]
