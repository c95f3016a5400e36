"""The reader understands real pickles and never runs, hangs or crashes on any other."""

import collections
import os
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.errors import UsageError
from drs_core.importing.arrays import array, number
from drs_core.importing.pickle_data import Call, Name, read_pickle

plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.binary(),
    lambda inner: st.lists(inner) | st.tuples(inner, inner) | st.dictionaries(st.text() | st.integers(), inner),
    max_leaves=12,
)


def everything(_: Name) -> bool:
    return True


@settings(max_examples=200, deadline=None)
@given(plain, st.integers(3, 5))
def test_plain_values_are_read_as_pickle_would(value, protocol):
    assert read_pickle(pickle.dumps(value, protocol), "x", everything) == value


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(content):
    try:
        read_pickle(content, "x", everything)
    except UsageError as error:
        assert len(str(error)) < 300


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_a_damaged_pickle_is_read_or_refused(data):
    content = bytearray(pickle.dumps({"a": [np.arange(3.0), collections.OrderedDict(x=1)], "b": {1, 2}}))
    for _ in range(data.draw(st.integers(1, 5))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    try:
        array(read_pickle(bytes(content), "x", everything)["a"][0], "x")
    except (UsageError, TypeError, KeyError, IndexError, AttributeError):
        pass  # the caller's own checks; what matters is that nothing else happens


class Evil:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (self.path,)


@pytest.mark.parametrize("protocol", range(6))
def test_nothing_is_run(tmp_path, protocol):
    target = tmp_path / "made"
    content = pickle.dumps({"a": Evil(str(target))}, protocol)
    record = read_pickle(content, "x", everything)["a"]
    assert isinstance(record, Call) and record.arguments == (str(target),)
    with pytest.raises(UsageError, match="mkdir"):
        read_pickle(content, "x", lambda name: name.module == "numpy")
    assert not target.exists()


@pytest.mark.parametrize(
    "content",
    [
        b"\x80\x05\x96\xff\xff\xff\xff\xff\xff\xff\x7f.",  # a bytearray of 2^63 bytes
        b"\x80\x04Nr\xff\xff\xff\xff.",  # memo number 2^32 - 1
        b"\x80\x02\x8a\xff",  # a cut-off integer
        b"\x80\x02)" + b"2\x86" * 60 + b"N}" + b".",
        b"\x80\x02)" + b"2\x86" * 60 + b"}(" + b".",
        b"cos\nsystem\n(S'touch x'\ntR.",
        b"(ios\nsystem\n.",
        b"\x82\x01.",  # an extension code
        b"(" * 100_000 + b".",
    ],
)
def test_hostile_programs_are_harmless(content):
    try:
        read_pickle(content, "x", lambda name: False)
    except UsageError as error:
        assert len(str(error)) < 300


def test_a_shared_tuple_is_no_dictionary_key():
    nested = b")" + b"2\x86" * 60  # a tuple of 2^60 leaves, whose hash would take for ever
    with pytest.raises(UsageError):
        read_pickle(b"\x80\x02}" + nested + b"Ns.", "x", everything)


@pytest.mark.parametrize("protocol", [2, 3, 4, 5])
@pytest.mark.parametrize("dtype", ["f4", "f8", ">f8", "i8", "b1"])
def test_arrays_and_scalars(protocol, dtype):
    values = np.arange(6).reshape(2, 3).astype(dtype)
    for expected in (values, np.asfortranarray(values)):
        record = read_pickle(pickle.dumps(expected, protocol), "x", everything)
        np.testing.assert_array_equal(array(record, "x"), expected)
    scalar = read_pickle(pickle.dumps(values[1, 0], protocol), "x", everything)
    assert number(scalar, "x") == float(values[1, 0])


def test_an_array_whose_shape_lies_is_refused():
    content = pickle.dumps(np.arange(3.0), 2)
    record = read_pickle(content, "x", everything)
    record.state = (1, (10**12,), *record.state[2:])
    with pytest.raises(UsageError, match="do not fit"):
        array(record, "x")
    with pytest.raises(UsageError, match="plain number"):
        array(read_pickle(pickle.dumps(np.array([object()])), "x", everything), "x")
