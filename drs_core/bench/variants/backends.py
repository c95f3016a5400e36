"""The backends of this project's own rollouts, as far as this version has them."""

from __future__ import annotations

from inspect import signature

from drs_core.rollouts import InProcess

DEFAULT, COMPILED = "python", "compiled"


def has_choice() -> bool:
    """Whether rollouts take a backend at all."""
    return "backend" in signature(InProcess).parameters


def backends() -> tuple[str, ...]:
    """Names, the plain one first."""
    return (DEFAULT, COMPILED) if has_choice() else (DEFAULT,)
