"""Import panda-gym without scipy: only its Flip task uses it, and it costs 27 MB and half a second."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

_PACKAGES = ("scipy", "scipy.spatial")
_MODULE = "scipy.spatial.transform"


class _Later:
    """Stands for scipy's Rotation, and imports it when it is first used."""

    def __getattr__(self, name: str) -> Any:
        from scipy.spatial.transform import Rotation

        return getattr(Rotation, name)


@contextmanager
def without_scipy() -> Iterator[None]:
    """Inside, ``from scipy.spatial.transform import Rotation`` gives something that imports it later."""
    if any(name in sys.modules for name in (*_PACKAGES, _MODULE)):
        yield
        return
    for name in (*_PACKAGES, _MODULE):
        sys.modules[name] = ModuleType(name)
    sys.modules[_MODULE].Rotation = _Later()  # type: ignore[attr-defined]
    try:
        yield
    finally:
        for name in (*_PACKAGES, _MODULE):
            del sys.modules[name]
