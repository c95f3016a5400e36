"""An optional accelerator for locomotion: a whole rollout in one call of a compiled helper."""

from drs_core.accelerator.backend import BACKENDS, COMPILED, PLAIN, PYTHON, Runner, check_backend, choose, make_runner

__all__ = ["BACKENDS", "COMPILED", "PLAIN", "PYTHON", "Runner", "check_backend", "choose", "make_runner"]
