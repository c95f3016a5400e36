"""Read a pickle as data: nothing is imported, called or built from it.

A pickle is a program for a stack machine. This reader runs the machine, but where Python's would
import a name it notes the name, and where Python's would call it notes the call. What comes out are
plain values and ``Call`` records, for others to interpret.
"""

from __future__ import annotations

import pickletools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from drs_core.errors import UsageError


@dataclass(frozen=True)
class Name:
    """A name that the pickle would import."""

    module: str
    name: str

    def __str__(self) -> str:
        """The dotted name."""
        return f"{self.module}.{self.name}"


@dataclass(frozen=True)
class Persistent:
    """A reference to something stored outside the pickle, such as a tensor's storage."""

    identity: Any


@dataclass(eq=False)
class Call:
    """A call that the pickle would make, and what it would then do to the result."""

    function: Any
    arguments: Any
    state: Any = None
    items: dict[Any, Any] = field(default_factory=dict)
    members: list[Any] = field(default_factory=list)

    def is_of(self, *names: str) -> bool:
        """Whether the function is one of these dotted names."""
        return isinstance(self.function, Name) and str(self.function) in names


_MARK = object()
_CONSTANTS: dict[str, Callable[[], Any]] = {
    "NONE": lambda: None,
    "NEWTRUE": lambda: True,
    "NEWFALSE": lambda: False,
    "EMPTY_TUPLE": lambda: (),
    "EMPTY_LIST": list,
    "EMPTY_DICT": dict,
    "EMPTY_SET": set,
}
_VALUES = (
    {"INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "LONG4", "FLOAT", "BINFLOAT"}
    | {"STRING", "BINSTRING", "SHORT_BINSTRING", "UNICODE", "SHORT_BINUNICODE", "BINUNICODE", "BINUNICODE8"}
    | {"BINBYTES", "SHORT_BINBYTES", "BINBYTES8", "BYTEARRAY8"}
)
_KEYS = (str, bytes, int, float, type(None), Name)
"""What may be hashed: a tuple of tuples of tuples … could take for ever."""
_TUPLES = {"TUPLE1": 1, "TUPLE2": 2, "TUPLE3": 3}
_IGNORED = {"PROTO", "FRAME", "STOP"}


def read_pickle(content: bytes, name: str, allowed: Callable[[Name], bool]) -> Any:
    """What a pickle describes, as plain values, Name, Call and Persistent records.

    Args:
        content: the pickle.
        name: what to call it in errors.
        allowed: says which names may stand in it.

    Raises:
        UsageError: it is not a pickle, names something else, or uses an opcode that data does not need.
    """
    machine = _Machine(allowed)
    try:
        for opcode, argument, _ in pickletools.genops(content):
            machine.run(opcode.name, argument)
        return machine.stack.pop()
    except UsageError as error:
        raise UsageError(f"{name} is refused: {error}") from error
    except Exception as error:  # a malformed program can fail in any way, and none is of interest
        raise UsageError(f"{name} is not a readable pickle ({str(error)[:120] or type(error).__name__}).") from error


def _key(value: Any) -> Any:
    if not isinstance(value, _KEYS):
        raise ValueError("a key that is no plain value")
    return value


class _Machine:
    def __init__(self, allowed: Callable[[Name], bool]) -> None:
        self.stack: list[Any] = []
        self._memo: dict[int, Any] = {}
        self._allowed = allowed

    def run(self, opcode: str, argument: Any) -> None:
        if opcode in _IGNORED:
            return
        if opcode in _VALUES:
            self.stack.append(argument)
        elif opcode in _CONSTANTS:
            self.stack.append(_CONSTANTS[opcode]())
        elif opcode in _TUPLES:
            count = _TUPLES[opcode]
            self.stack[-count:] = [tuple(self.stack[-count:])]
        elif opcode == "MEMOIZE":
            self._memo[len(self._memo)] = self.stack[-1]
        elif opcode.endswith("GET"):
            self.stack.append(self._memo[int(argument)])
        elif opcode.endswith("PUT"):
            self._memo[int(argument)] = self.stack[-1]
        else:
            method = getattr(self, f"_{opcode.lower()}", None)
            if method is None:
                raise UsageError(f"it uses the opcode {opcode}, which no data needs.")
            method(argument)

    def _marked(self) -> list[Any]:
        for index in range(len(self.stack) - 1, -1, -1):
            if self.stack[index] is _MARK:
                items = self.stack[index + 1 :]
                del self.stack[index:]
                return items
        raise ValueError("no mark")

    def _mark(self, _: Any) -> None:
        self.stack.append(_MARK)

    def _pop(self, _: Any) -> None:
        self.stack.pop()

    def _pop_mark(self, _: Any) -> None:
        self._marked()

    def _dup(self, _: Any) -> None:
        self.stack.append(self.stack[-1])

    def _tuple(self, _: Any) -> None:
        self.stack.append(tuple(self._marked()))

    def _list(self, _: Any) -> None:
        self.stack.append(self._marked())

    def _dict(self, _: Any) -> None:
        items = self._marked()
        self.stack.append({_key(key): value for key, value in zip(items[::2], items[1::2], strict=True)})

    def _frozenset(self, _: Any) -> None:
        self.stack.append(frozenset(map(_key, self._marked())))

    def _append(self, _: Any) -> None:
        self._extend([self.stack.pop()])

    def _appends(self, _: Any) -> None:
        self._extend(self._marked())

    def _extend(self, items: list[Any]) -> None:
        target = self.stack[-1]
        (target.members if isinstance(target, Call) else target).extend(items)

    def _additems(self, _: Any) -> None:
        items = self._marked()
        self.stack[-1].update(map(_key, items))

    def _setitem(self, _: Any) -> None:
        value = self.stack.pop()
        self._update([self.stack.pop(), value])

    def _setitems(self, _: Any) -> None:
        self._update(self._marked())

    def _update(self, items: list[Any]) -> None:
        target = self.stack[-1]
        entries = target.items if isinstance(target, Call) else target
        entries.update({_key(key): value for key, value in zip(items[::2], items[1::2], strict=True)})

    def _global(self, argument: str) -> None:
        self._push_name(*argument.split(" ", 1))

    def _stack_global(self, _: Any) -> None:
        name = self.stack.pop()
        self._push_name(self.stack.pop(), name)

    def _push_name(self, module: Any, name: Any) -> None:
        if not isinstance(module, str) or not isinstance(name, str):
            raise ValueError("a name that is no text")
        found = Name(module, name)
        if not self._allowed(found):
            raise UsageError(f"it names {str(found)[:100]}, which has no place there; nothing of it was run.")
        self.stack.append(found)

    def _reduce(self, _: Any) -> None:
        arguments = self.stack.pop()
        self.stack.append(Call(self.stack.pop(), arguments))

    _newobj = _reduce

    def _newobj_ex(self, _: Any) -> None:
        self.stack.pop()
        self._reduce(None)

    def _build(self, _: Any) -> None:
        state = self.stack.pop()
        self.stack[-1].state = state

    def _binpersid(self, _: Any) -> None:
        self.stack.append(Persistent(self.stack.pop()))
