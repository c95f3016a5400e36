"""The model of growth keeps to arithmetic that can be done by hand, and its steps write their files."""

from __future__ import annotations

import itertools
import math
import subprocess
import sys
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.errors import UsageError
from scripts.growth.costs import Costs, load_costs, save_costs
from scripts.growth.episodes import draw, load_episodes
from scripts.growth.model import simulate
from scripts.growth.points import AS_IT_IS, NEAR, ONE_CLIENT, ONE_LINK, TUNERS, costs_of, load_points, point
from scripts.growth.rules import ROOT, product_rules

RULES = product_rules()
RESULTS = ROOT / "docs" / "results"
SOME = Costs(*(1e-4 * (place + 1) for place in range(16)))
DURATIONS = st.lists(st.integers(1, 4000).map(lambda ms: ms / 1000), min_size=2, max_size=60).filter(
    lambda found: len(found) % 2 == 0
)


def test_one_simulator_takes_its_work_and_nothing_else_where_nothing_costs():
    durations = [0.25, 0.5, 0.75, 0.125] * 4
    outcome = simulate([durations] * 3, 1, Costs(), RULES)
    assert outcome.ends_s == (sum(durations), 2 * sum(durations), 3 * sum(durations))
    assert outcome.tuner_s == 0.0


def test_one_simulator_with_every_cost_takes_what_is_added_up_by_hand():
    # two tasks, one a batch: theta is sent, answered, then both batches are sent, one answer after the other
    costs, latency, episode = SOME, 0.02, 0.7
    outcome = simulate([[episode, episode]], 1, costs, RULES, latency)
    turn = costs.turn_s + costs.turn_link_s
    wake = costs.wake_s + costs.wake_link_s
    send, take = costs.send_call_s + costs.send_episode_s, costs.take_call_s + costs.take_episode_s
    run = costs.simulator_call_s + costs.simulator_episode_s + episode
    theta = turn + costs.graph_link_s + costs.theta_s + latency + costs.simulator_theta_s + latency + wake
    begun = theta + turn + send + latency  # the second batch waits beside it
    # the look at the graph is due again in the turn after the first answer, while the second batch runs
    end = begun + 2 * run + latency + wake + take + costs.update_s + costs.direction_s
    assert outcome.ends_s[0] == pytest.approx(end, abs=1e-9)


@pytest.mark.parametrize("simulators", [2, 4, 8])
def test_equal_episodes_without_costs_end_together(simulators):
    durations = [0.5] * (16 * simulators)
    outcome = simulate([durations] * 2, simulators, Costs(), RULES)
    assert outcome.ends_s == (8.0, 16.0)
    assert outcome.rollouts_per_second() == 2.0 * simulators


@given(DURATIONS, st.integers(1, 40), st.sampled_from([0.0, 0.0002, 0.02]))
@settings(max_examples=60, deadline=None)
def test_it_is_never_above_ideal_and_never_shorter_than_an_episode(durations, simulators, latency_s):
    outcome = simulate([durations] * 3, simulators, SOME, RULES, latency_s)
    assert outcome.rollouts_per_second() <= simulators * len(durations) / sum(durations) * (1 + 1e-9)
    took = [end - begin for begin, end in zip((0.0, *outcome.ends_s), outcome.ends_s)]
    # an update may end with a copy, which is not sent before the first one has begun
    assert min(took) >= max(durations)


@given(DURATIONS, st.integers(1, 40))
@settings(max_examples=60, deadline=None)
def test_every_episode_is_run_once_but_for_copies(durations, simulators):
    outcome = simulate([durations, durations], simulators, SOME, RULES, NEAR)
    assert len(outcome.ran) == 2 and all(len(ran) == len(durations) and min(ran) >= 1 for ran in outcome.ran)
    assert sum(map(sum, outcome.ran)) == 2 * len(durations) + outcome.copies == sum(outcome.sizes)


def test_a_late_episode_is_run_again_by_who_is_idle():
    # after the first update an episode is known to take 0.1 s; then one takes 30 s
    usual, stuck = [0.1] * 8, [0.1] * 7 + [30.0]
    outcome = simulate([usual, stuck], 4, Costs(), RULES)
    assert outcome.copies >= 3 and Counter(outcome.ran[1])[1] == 7
    assert outcome.ran[0] == (1,) * 8


def test_more_simulators_give_more_until_the_tuner_is_the_limit():
    pairs = load_episodes(RESULTS / "growth_episodes.csv")["Hopper"]
    free = [
        simulate(draw(pairs, 64, 3, 0), count, Costs(), RULES).rollouts_per_second() for count in (1, 2, 4, 8, 16, 32)
    ]
    assert all(more >= 0.97 * less for less, more in itertools.pairwise(free)), free
    assert free[1] > 1.8 * free[0]
    slow = Costs(take_episode_s=0.5)
    busy = simulate(draw(pairs, 64, 3, 0), 32, slow, RULES)
    assert busy.rollouts_per_second() <= 2.0
    assert busy.tuner_s / busy.ends_s[-1] > 0.95


def test_a_cost_for_every_simulator_makes_many_slower_than_few():
    pairs, costs = [(0.5, 0.5)], Costs(turn_link_s=1e-4)
    few, many = (
        point("arm", pairs, costs, RULES, AS_IT_IS, NEAR, 64, count).rollouts_per_second for count in (64, 1024)
    )
    assert many < few
    mended = point("arm", pairs, costs, RULES, ONE_LINK, NEAR, 64, 1024)
    assert mended.rollouts_per_second > 2 * many
    assert costs_of(AS_IT_IS, SOME) is SOME
    assert costs_of(ONE_LINK, SOME).wake_link_s == SOME.wake_link_s and costs_of(ONE_CLIENT, SOME).wake_link_s == 0.0


def test_the_same_seed_draws_the_same_update_with_both_sides_of_a_direction_together():
    pairs = [(1.0, 2.0), (3.0, 4.0), (5.0, 6.0)]
    assert draw(pairs, 20, 2, 7) == draw(pairs, 20, 2, 7) != draw(pairs, 20, 2, 8)
    for update in draw(pairs, 20, 2, 7):
        assert len(update) == 40 and set(zip(update[::2], update[1::2])) <= set(pairs)
    one, other = (simulate(draw(pairs, 20, 2, 7), 5, SOME, RULES, NEAR) for _ in range(2))
    assert one == other


def test_wrong_costs_are_refused_by_name_and_right_ones_are_kept(tmp_path):
    for value in (-1.0, math.nan, math.inf):
        with pytest.raises(UsageError, match="wake_s is"):
            Costs(wake_s=value)
    save_costs(tmp_path / "costs.json", {"arm": {"wake_s": 0.00123456}}, {"machine": "here"})
    assert load_costs(tmp_path / "costs.json") == {"arm": Costs(wake_s=0.001235)}


def steps(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "scripts.growth", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=ROOT)


def test_the_steps_run_in_a_short_form_and_write_their_files(tmp_path):
    (tmp_path / "growth_costs.json").write_text((RESULTS / "growth_costs.json").read_text())
    short = ("--results", tmp_path, "--figure", tmp_path / "growth.png", "--short")
    for step in (("episodes", "Hopper=hopper_sac", "PandaReach=panda_reach"), ("points",), ("figure",)):
        result = steps(*step, *short)
        assert result.returncode == 0, result.stderr
    assert {len(sides) for pairs in load_episodes(tmp_path / "growth_episodes.csv").values() for sides in pairs} == {2}
    points = load_points(tmp_path / "growth.csv")
    assert {one.simulators for one in points} == {1, 4} and {one.tuner for one in points} == set(TUNERS)
    assert all(0 < one.rollouts_per_second <= one.ideal and 0 <= one.tuner_busy <= 1 for one in points)
    assert (tmp_path / "growth.png").read_bytes().startswith(b"\x89PNG")


def test_a_mistake_ends_with_a_sentence(tmp_path):
    result = steps("episodes", "panda_reach", "--results", tmp_path)
    assert result.returncode == 1 and "NAME=AGENT" in result.stderr and "Traceback" not in result.stderr


def test_the_points_that_are_kept_are_those_of_the_model():
    kept = load_points(RESULTS / "growth.csv")
    costs, episodes = load_costs(RESULTS / "growth_costs.json"), load_episodes(RESULTS / "growth_episodes.csv")
    for one in kept[:: len(kept) // 7]:
        if one.simulators <= 256:
            again = point(
                one.agent, episodes[one.agent], costs[one.agent], RULES, one.tuner, one.latency_s, one.directions,
                one.simulators,
            )  # fmt: skip
            assert again == one
