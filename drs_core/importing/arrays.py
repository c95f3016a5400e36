"""Numpy arrays and scalars out of pickle records, every size checked before it is believed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drs_core.errors import UsageError
from drs_core.importing.pickle_data import Call

_KINDS = {"f2", "f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "b1"}
_CORE = ("numpy.core", "numpy._core")
_RECONSTRUCT = tuple(f"{core}.multiarray._reconstruct" for core in _CORE)
_SCALAR = tuple(f"{core}.multiarray.scalar" for core in _CORE)
_FROM_BUFFER = tuple(f"{core}.numeric._frombuffer" for core in _CORE)


def number(record: Any, name: str) -> float:
    """A Python number or a numpy scalar or one-element array, as float."""
    if isinstance(record, (int, float)):
        try:
            return float(record)
        except OverflowError as error:
            raise UsageError(f"{name} is out of range.") from error
    values = array(record, name)
    if values.size != 1:
        raise UsageError(f"{name} is not one number.")
    return float(values.reshape(-1)[0])


def array(record: Any, name: str) -> NDArray[np.float64]:
    """The array that a record describes, as float64.

    Raises:
        UsageError: it describes something else, or its data do not fit its shape.
    """
    try:
        if isinstance(record, Call) and record.is_of(*_RECONSTRUCT):
            _, shape, dtype, fortran, content = record.state
            return _view(content, _dtype(dtype), shape, bool(fortran))
        if isinstance(record, Call) and record.is_of(*_FROM_BUFFER):
            content, dtype, shape, order = record.arguments
            return _view(content, _dtype(dtype), shape, order == "F")
        if isinstance(record, Call) and record.is_of(*_SCALAR):
            dtype, content = record.arguments
            return _view(content, _dtype(dtype), (), False)
    except (TypeError, ValueError, KeyError, IndexError, AttributeError) as error:
        raise UsageError(f"{name} is not a readable array: {error}.") from error
    raise UsageError(f"{name} is not an array of numbers.")


def _view(stored: Any, dtype: np.dtype[Any], shape: Any, fortran: bool) -> NDArray[np.float64]:
    content = stored
    if isinstance(stored, Call) and stored.is_of("_codecs.encode"):
        # protocol 2 has no bytes, and stores them as text
        content = stored.arguments[0].encode("latin1")
    if not isinstance(content, (bytes, bytearray)):
        raise ValueError("its numbers are not stored as bytes")
    sizes = tuple(int(size) for size in shape)
    if len(sizes) > 8 or any(size < 0 for size in sizes) or math.prod(sizes) * dtype.itemsize != len(content):
        raise ValueError(f"{len(content)} bytes do not fit the shape {sizes}")
    values = np.frombuffer(content, dtype).reshape(sizes, order="F" if fortran else "C")
    return values.astype(np.float64)


def _dtype(record: Any) -> np.dtype[Any]:
    kind = record.arguments[0] if isinstance(record, Call) and record.is_of("numpy.dtype") else None
    if not isinstance(kind, str) or kind not in _KINDS:
        raise ValueError("its type is not a plain number")
    order = record.state[1] if record.state is not None else "<"
    return np.dtype(kind).newbyteorder(">" if order == ">" else "<")
