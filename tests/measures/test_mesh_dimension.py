import csv
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.measures.mesh_dimension import MeshDimension, box_count, measure_dimension, mesh_dimension


def test_values_of_the_authors_program(shared):
    trajectories = np.load(shared / "golden" / "trajectories.npz")
    with open(shared / "golden" / "mesh_dimension.csv") as file:
        for row in csv.DictReader(file):
            lower, upper = mesh_dimension(trajectories[row["trajectory"]])
            assert lower == pytest.approx(float(row["lower_bound"]), abs=1e-6)
            assert upper == pytest.approx(float(row["upper_bound"]), abs=1e-6)


# values of this implementation, kept so that a change shows where the shared golden files are absent
GOLDEN = {
    "line": (1, 0.5825968374, 2.2239010857),
    "square": (2, 1.0353831177, 4.4478021715),
    "cube": (3, 1.0465122378, 6.4647045421),
}


@pytest.mark.parametrize("name", GOLDEN)
def test_own_golden_values(name):
    features, lower, upper = GOLDEN[name]
    points = np.random.default_rng(0).uniform(0, 1, (500, features)) @ np.eye(features, 3)
    assert mesh_dimension(points) == pytest.approx((lower, upper), abs=1e-6)


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 60), st.integers(1, 5), st.sampled_from([np.float32, np.float64]), st.integers(0, 2**32 - 1))
def test_counts_equal_those_of_unique(steps, features, dtype, seed):
    rng = np.random.default_rng(seed)
    points = (rng.standard_normal((steps, features)) * 10 ** rng.uniform(-3, 3)).astype(dtype)
    for d in (0.01, 0.3, 1.0, 1.7):
        assert box_count(points, d) == len(np.unique(np.round(points * (1 / d)), axis=0))


@settings(max_examples=80, deadline=None)
@given(st.integers(1, 40), st.integers(1, 4), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e-6, 1.0, 1e6]))
def test_it_ends_and_its_clipped_mean_is_within_the_limit(steps, features, seed, scale):
    points = scale * np.random.default_rng(seed).standard_normal((steps, features))
    measured = measure_dimension(points)
    assert measured.limit == features / 2
    assert 0.0 <= measured.clipped_mean() <= measured.limit
    assert math.isfinite(measured.mean())


def test_what_cannot_be_computed_counts_as_the_limit():
    assert MeshDimension(math.nan, math.nan, 3.5).mean() == 3.5
    assert MeshDimension(-0.5, 9.0, 3.5).clipped_mean() == 1.75
    assert MeshDimension(-0.5, 9.0, 3.5).mean() == 4.25
    assert all(map(math.isnan, mesh_dimension(np.zeros((1, 3)))))


@pytest.mark.parametrize("points", [np.zeros(3), np.full((3, 2), np.nan), np.full((3, 2), np.inf)])
def test_what_is_no_trajectory_is_refused(points):
    with pytest.raises(ValueError):
        mesh_dimension(points)
