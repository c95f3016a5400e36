"""The sums of fast stepping are numpy's, bit for bit."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.environments.fast.float32 import MOST, least_above, mean_float32, pairwise_sum

doubles = st.floats(-1e9, 1e9)
singles = st.floats(-1e9, 1e9, width=32)


@settings(max_examples=300, deadline=None)
@given(st.lists(doubles, min_size=1, max_size=MOST))
def test_a_sum_adds_in_numpys_order(x):
    assert pairwise_sum(x) == np.add.reduce(np.array(x))
    # as upstream does, over every third number
    assert pairwise_sum(x) == np.repeat(np.array(x), 3)[::3].sum()


@settings(max_examples=300, deadline=None)
@given(st.lists(singles, min_size=1, max_size=8), st.lists(singles, min_size=8, max_size=8))
def test_a_mean_of_products_rounds_where_float32_rounds(x, y):
    a, b = np.array(x, np.float32), np.array(y[: len(x)], np.float32)
    assert mean_float32([abs(p * q) for p, q in zip(x, y)]) == float(np.abs(a * b).mean())
    assert mean_float32([p * p for p in x]) == float(np.square(a).mean())


@settings(max_examples=200, deadline=None)
@given(st.floats(-1e30, 1e30))
def test_the_least_number_above_a_bound(bound):
    least = least_above(bound)
    assert np.float32(least) > np.float32(bound) >= np.float32(np.nextafter(least, -np.inf))
