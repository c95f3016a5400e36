"""PyTorch's weight files read without PyTorch: a zip of raw storages and a pickle that names them.

The pickle is read as data (``pickle_data``), so neither PyTorch nor any code from the file runs, and
importing an agent needs no PyTorch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from drs_core.errors import UsageError
from drs_core.importing.archive import Archive
from drs_core.importing.pickle_data import Call, Name, Persistent, read_pickle
from drs_core.policy import MAX_PARAMETERS

MAX_INDEX_BYTES = 4 * 2**20
_STORAGES = {"FloatStorage": "<f4", "DoubleStorage": "<f8", "HalfStorage": "<f2", "LongStorage": "<i8"}
_TENSOR = "torch._utils._rebuild_tensor_v2"
_PARAMETER = "torch._utils._rebuild_parameter"
_OTHERS = {_TENSOR, _PARAMETER, "collections.OrderedDict"}


@dataclass(frozen=True)
class Tensor:
    """A tensor that has not been read yet."""

    name: str
    shape: tuple[int, ...]
    strides: tuple[int, ...]
    offset: int
    storage: str
    dtype: str
    archive: Archive

    def array(self) -> NDArray[np.float32]:
        """The tensor as float32.

        Raises:
            UsageError: it reaches outside its storage, is too large or not finite.
        """
        count = math.prod(self.shape)
        if not 0 < count <= MAX_PARAMETERS:
            raise UsageError(f"the weights {self.name} have {count} elements; allowed are 1..{MAX_PARAMETERS}.")
        content = self.archive.read(self.storage)
        if len(content) % np.dtype(self.dtype).itemsize:
            raise UsageError(f"the weights {self.name} have a storage of {len(content)} bytes, no whole numbers.")
        values = np.frombuffer(content, self.dtype)
        reach = self.offset + sum((size - 1) * stride for size, stride in zip(self.shape, self.strides, strict=True))
        if self.offset < 0 or min(self.strides, default=0) < 0 or reach >= len(values):
            raise UsageError(f"the weights {self.name} reach outside their storage.")
        steps = [stride * values.itemsize for stride in self.strides]
        result = as_strided(values[self.offset :], self.shape, steps).astype(np.float32)
        if not np.isfinite(result).all():
            raise UsageError(f"the weights {self.name} hold numbers that are not finite.")
        return result


def read_weights(content: bytes, name: str) -> dict[str, Tensor]:
    """The tensors of a state dict, by name.

    Raises:
        UsageError: it is not a state dict saved by PyTorch 1.6 or later.
    """
    archive = Archive(content, name)
    index = next((member for member in archive.names if member.split("/")[1:] == ["data.pkl"]), None)
    if index is None:
        raise UsageError(f"{name} was not saved by PyTorch 1.6 or later; save it again with a newer one.")
    folder = index.rpartition("/")[0]
    if f"{folder}/byteorder" in archive.names and archive.read(f"{folder}/byteorder") != b"little":
        raise UsageError(f"{name} was saved on a big-endian machine; save it again on a little-endian one.")
    state = read_pickle(archive.read(index, MAX_INDEX_BYTES), name, _allowed)
    tensors = state.items if isinstance(state, Call) else state
    if not isinstance(tensors, dict):
        raise UsageError(f"{name} holds no state dict.")
    return {str(key): _tensor(str(key), value, folder, archive) for key, value in tensors.items()}


def _allowed(name: Name) -> bool:
    return str(name) in _OTHERS or (name.module == "torch" and name.name.endswith("Storage"))


def _tensor(name: str, record: Any, folder: str, archive: Archive) -> Tensor:
    try:
        if isinstance(record, Call) and record.is_of(_PARAMETER):
            record = record.arguments[0]
        if not (isinstance(record, Call) and record.is_of(_TENSOR)):
            raise ValueError("no tensor")
        persistent, offset, shape, strides = record.arguments[:4]
        if not isinstance(persistent, Persistent):
            raise ValueError("no storage")
        _, kind, key = persistent.identity[:3]
        if not isinstance(kind, Name) or not isinstance(key, str):
            raise ValueError("a storage without a name")
        sizes, steps = tuple(map(int, shape)), tuple(map(int, strides))
        if any(size < 0 for size in sizes) or len(sizes) != len(steps) or len(sizes) > 8:
            raise ValueError("a shape that no tensor has")
        return Tensor(name, sizes, steps, int(offset), f"{folder}/data/{key}", _STORAGES[kind.name], archive)
    except (KeyError, ValueError, TypeError, AttributeError, IndexError) as error:
        raise UsageError(f"the weights {name[:80]} are not stored as a plain tensor ({error}).") from error
