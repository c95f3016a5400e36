"""What a step is worth where episodes were broken off: dropped pairs leave no bias, dropped sides do."""

import numpy as np
import pytest

from drs_core.search import SearchConfig, direction, tell

D, N, RUNS, SIGMA, LEVEL = 3, 32, 400, 0.05, 10.0
NAN = float("nan")


def config(seed):
    return SearchConfig(updates=1, directions=N, alpha=(1.0, 1.0), sigma=(SIGMA, SIGMA), seed=seed)


def mean_steps(slope, breaks):
    """Mean step over RUNS, (D,) each: by pairs as tell() takes them, and by sides, the failed ones left out alone.

    The reward of x is LEVEL + slope . x. `breaks` (deltas (N, D), generator) says which sides break off, (N, 2) bool.
    """
    by_pairs, by_sides = [], []
    for seed in range(RUNS):
        deltas = np.stack([direction(seed, 0, i, D) for i in range(N)]).astype(np.float64)
        sides = np.array([1.0, -1.0])
        rewards = LEVEL + SIGMA * (deltas @ slope)[:, None] * sides
        broken = breaks(deltas, np.random.default_rng(seed))
        objectives = np.where(broken.any(axis=1, keepdims=True), NAN, rewards)
        by_pairs.append(tell(config(seed), 0, np.zeros(D, np.float32), objectives))
        weights = np.where(broken, 0.0, rewards * sides).sum(axis=1)
        by_sides.append(weights @ deltas / ((~broken).sum() / 2 * rewards[~broken].std()))
    return np.mean(by_pairs, axis=0), np.mean(by_sides, axis=0)


ALONG = np.array([0.0, 1.0, 0.0])
EXPECTED = 2.0 * ALONG
"""Of n undisturbed pairs: 2 sigma slope / s, and s is sigma here."""
CLOSE = 0.08


@pytest.mark.parametrize("sides", [(True, True), (True, False)], ids=["either side", "one side only"])
def test_pairs_dropped_whatever_they_give_leave_the_expected_step(sides):
    found, _ = mean_steps(ALONG, lambda deltas, rng: (rng.random((N, 2)) < 0.3) & np.array(sides))
    np.testing.assert_allclose(found, EXPECTED, atol=CLOSE)


def wall(deltas, rng):
    """A candidate that has moved half a sigma along the first parameter is stopped; its mirror image is not."""
    return np.stack([deltas[:, 0] > 0.5, deltas[:, 0] < -0.5], axis=1)


def test_a_wall_on_one_side_does_not_move_the_step_but_dropping_the_failed_side_alone_does():
    by_pairs, by_sides = mean_steps(ALONG, wall)
    np.testing.assert_allclose(by_pairs, EXPECTED, atol=CLOSE)
    # fleeing the wall by the level of the rewards, which means nothing
    assert by_sides[0] < -10.0


def test_along_what_breaks_episodes_off_the_step_is_that_of_pairs_that_finish_both():
    across = np.array([1.0, 0.0, 0.0])
    by_pairs, _ = mean_steps(across, wall)
    assert 0.2 < by_pairs[0] < 1.0
    np.testing.assert_allclose(by_pairs[1:], 0.0, atol=CLOSE)
