"""The compiled helper as Python sees it: its structures, its functions, and a client of a PyBullet world."""

from __future__ import annotations

import ctypes
import importlib.metadata
from ctypes import POINTER, c_char_p, c_double, c_float, c_int, c_int32, c_void_p
from functools import cache
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from drs_core.accelerator.build import FOLDER, LIBRARY, source_digest
from drs_core.environments import quiet
from drs_core.errors import DrsError

PROVED = {"pybullet": "3.2.7", "pybullet-envs-gymnasium": "0.6.0"}
"""Versions whose episodes the tests compare with the helper's, bit for bit."""
NOT_FINITE_ACTION = -3
"""Of the results of drs_rollout the one that is the policy's doing; 0 is success."""

_MEND = "mend it with: python -m drs_core.accelerator (needs a C compiler)"


class Unavailable(DrsError):
    """The accelerator cannot run this; the message says why and what mends it."""


def _fields(kind: Any, names: str) -> list[tuple[str, Any]]:
    return [(name, kind) for name in names.split()]


class Robot(ctypes.Structure):
    """``robot_t`` of rollout.c."""

    _fields_ = [
        *_fields(c_int32, "body floor_body torso_link n_joints n_parts n_feet n_bruising falls fused"),
        *_fields(POINTER(c_int32), "joint_q joint_u part_link foot_link bruising"),
        *_fields(POINTER(c_double), "joint_low joint_high joint_gain fixed"),
        *_fields(c_double, "least_height greatest_pitch target_x target_y dt"),
        *_fields(c_double, "electricity_cost stall_torque_cost limit_cost"),
    ]


class Policy(ctypes.Structure):
    """``policy_t`` of policy.h."""

    _fields_ = [
        *_fields(c_int32, "n_features time_index time_limit n_layers activation squashed"),
        ("mean_clip", c_double),
        *_fields(POINTER(c_double), "mean scale clip"),
        ("sizes", POINTER(c_int32)),
        ("parameters", POINTER(c_float)),
        *_fields(POINTER(c_double), "low high scratch"),
    ]


class Record(ctypes.Structure):
    """``record_t`` of rollout.c."""

    _fields_ = [
        *_fields(c_int32, "capacity length terminated"),
        *_fields(POINTER(c_float), "observations features actions"),
        ("rewards", POINTER(c_double)),
        ("total", c_double),
    ]


_POINTERS: dict[str, Any] = {"int32": c_int32, "float32": c_float, "float64": c_double}


def pointer(array: NDArray[Any]) -> Any:
    """A C pointer to a contiguous array, which the caller keeps alive."""
    assert array.flags.c_contiguous
    return array.ctypes.data_as(POINTER(_POINTERS[array.dtype.name]))


@cache
def helper(path: Path = FOLDER / LIBRARY) -> ctypes.PyDLL:
    """The helper, bound to the PyBullet of this process.

    Raises:
        Unavailable: it is not there, of other sources, or PyBullet is not the one that it was proved against.
    """
    for package, proved in PROVED.items():
        try:
            found = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found = "missing"
        if found != proved:
            raise Unavailable(f"{package} is {found}, and only {proved} is proved: pip install {package}=={proved}")
    if not path.exists():
        raise Unavailable(f"the helper {path.name} was not compiled; {_MEND}")
    try:
        # PyDLL keeps the interpreter's lock: PyBullet must not be called from another thread meanwhile
        library = ctypes.PyDLL(str(path))
        library.drs_source_digest.restype = c_char_p
        library.drs_take_client.restype = c_void_p
        library.drs_rollout.argtypes = [c_void_p, POINTER(Robot), POINTER(Policy), POINTER(Record)]
        library.drs_rollout.restype = c_int
        digest = library.drs_source_digest().decode()
    except (OSError, AttributeError) as error:
        raise Unavailable(f"the helper {path.name} cannot be loaded ({error}); {_MEND}") from error
    if digest != source_digest():
        raise Unavailable(f"the helper {path.name} is of other sources than these; {_MEND}")
    with quiet():
        import pybullet

    if library.drs_bind(pybullet.__file__.encode()):
        raise Unavailable(f"{pybullet.__file__} lacks functions of Bullet's C interface; use PyBullet's own wheel")
    return library


_HANDLES: WeakKeyDictionary[Any, int] = WeakKeyDictionary()


def client_of(world: Any, path: Path = FOLDER / LIBRARY) -> int:
    """A handle of the helper's own client of the server behind a BulletClient; it ends when that one disconnects.

    Every server gives one, once: PyBullet does nothing where a plugin is there already, and crashes
    where it was unloaded and is loaded again.

    Raises:
        Unavailable: PyBullet refused the helper.
    """
    if world in _HANDLES:
        return _HANDLES[world]
    library = helper(path)
    with quiet():
        # Bullet checks its magic number here, which says that structures and commands are the declared ones
        plugin = world.loadPlugin(str(path), "_drs")
    handle = library.drs_take_client()
    if plugin < 0 or not handle:
        raise Unavailable("PyBullet refused the helper: its magic number is of another version of Bullet")
    _HANDLES[world] = int(handle)
    return _HANDLES[world]


def float64(values: Any) -> NDArray[np.float64]:
    """A contiguous array of its own."""
    return np.array(values, dtype=np.float64, order="C")


def int32(values: Any) -> NDArray[np.int32]:
    """A contiguous array of its own."""
    return np.array(values, dtype=np.int32, order="C")
