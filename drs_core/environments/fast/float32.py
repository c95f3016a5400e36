"""numpy's sums as plain Python: the same additions in the same order, hence the same bits.

numpy adds up to seven numbers one by one, and more in eight interleaved sums that are joined
pairwise (numpy/_core/src/umath/loops_utils.h.src, pairwise summation; recursion starts at 128).
A float32 operation is the float64 one rounded: with 53 bits against 24, rounding twice cannot differ.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence

import numpy as np

MOST = 127


def pairwise_sum(x: Sequence[float]) -> float:
    """``np.add.reduce`` of 1 to 127 float64 numbers."""
    count = len(x)
    if count < 8:
        total = x[0]
        for value in x[1:]:
            total += value
        return total
    a, b, c, d, e, f, g, h = x[:8]
    stop = count - count % 8
    for i in range(8, stop, 8):
        a += x[i]
        b += x[i + 1]
        c += x[i + 2]
        d += x[i + 3]
        e += x[i + 4]
        f += x[i + 5]
        g += x[i + 6]
        h += x[i + 7]
    total = ((a + b) + (c + d)) + ((e + f) + (g + h))
    for value in x[stop:]:
        total += value
    return total


def mean_float32(x: Sequence[float]) -> float:
    """``.mean()`` of a float32 array of 1 to 8 numbers, which are given exactly; the result is rounded."""
    cell, terms = _CELL, array("f", x)
    count = len(terms)
    if count == 8:
        a, b, c, d = array("f", (terms[0] + terms[1], terms[2] + terms[3], terms[4] + terms[5], terms[6] + terms[7]))
        a, b = array("f", (a + b, c + d))
        cell[0] = a + b
    else:
        cell[0] = terms[0]
        for value in terms[1:]:
            cell[0] += value
    cell[0] /= count
    return cell[0]


def least_above(bound: float) -> float:
    """The least float64 that rounds to a float32 above the float32 of `bound`."""
    edge = np.float32(bound)
    middle = (float(edge) + float(np.nextafter(edge, np.float32(np.inf)))) / 2.0
    return middle if np.float32(middle) > edge else math.nextafter(middle, math.inf)


_CELL = array("f", (0.0,))
