"""Turns, medians, ratios, tables: functions of numbers."""

from statistics import median

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drs_core.bench.config import BenchConfig, environment_ids, names
from drs_core.bench.interleave import interleaved, turns
from drs_core.bench.sample import Sample
from drs_core.bench.summary import ratio, ratios, spread, throughput, variant_summary
from drs_core.bench.tables import BEGIN, END, sentences, write_markdown
from drs_core.bench.variants import pairs, variants
from drs_core.bench.variants.ours import episode_count
from drs_core.environments import PAPER
from drs_core.errors import DrsError, UsageError

seconds = st.floats(1e-6, 1e6)


@given(st.integers(0, 12), st.integers(1, 6))
def test_every_variant_has_one_turn_a_round_and_everybody_is_first_in_turn(rounds, count):
    called = [f"v{index}" for index in range(count)]
    got = list(turns(called, rounds))
    assert len(got) == rounds * count
    for index in range(rounds):
        of_round = [name for r, name in got if r == index]
        assert sorted(of_round) == called
        assert of_round[0] == called[index % count]


def test_interleaved_keeps_results_in_the_order_of_rounds():
    log, done = [], []

    def job(name):
        return lambda index: log.append(name) or (name, index)

    results = interleaved({"a": job("a"), "b": job("b")}, 3, lambda: done.append(1))
    assert results == {"a": [("a", 0), ("a", 1), ("a", 2)], "b": [("b", 0), ("b", 1), ("b", 2)]}
    assert log == ["a", "b", "b", "a", "a", "b"] and len(done) == 6


@given(st.lists(st.tuples(seconds, seconds), min_size=1, max_size=9))
def test_a_ratio_lies_among_those_of_the_rounds_and_so_does_the_ratio_of_the_medians(pairs_of_rounds):
    over, under = ([pair[side] for pair in pairs_of_rounds] for side in (0, 1))
    got = ratio(over, under)
    assert got.low <= got.median <= got.high
    of_medians = median(over) / median(under)
    assert got.low * (1 - 1e-9) <= of_medians <= got.high * (1 + 1e-9)


def test_what_slows_a_whole_round_cancels_in_a_ratio():
    assert ratio([4.0, 40.0, 8.0], [2.0, 20.0, 4.0]) == spread([2.0])


def test_a_summary_holds_medians_over_rounds():
    rounds = [Sample(1000, 2, cpu, wall) for cpu, wall in ((0.1, 0.2), (0.5, 1.0), (0.2, 0.3))]
    got = variant_summary(rounds, episode_steps=500.0)
    assert got["cpu_us_per_step"] == pytest.approx(200.0)
    assert got["wall_s_per_128_rollouts"] == pytest.approx(0.3 / 1000 * 500 * 128)
    assert (got["steps"], got["rollouts"]) == (3000, 6)
    assert got["cores_used"] == pytest.approx(0.5)


@pytest.mark.parametrize(("cores", "said"), [(0.5, True), (0.97, False)])
def test_a_busy_machine_is_told(cores, said):
    environment = {"variants": {"python": {"cores_used": cores}}, "skipped": {}}
    machine = {"processor": "p", "cores": 2, "memory_gb": 8, "system": "s", "python": "3", "packages": {}}
    result = {"environments": {"e": environment}, "updates": {}, "titles": {}, "rounds": 1, "machine": machine}
    assert any("busy with other work" in sentence for sentence in sentences(result)) == said


def test_ratios_are_of_what_was_measured():
    samples = {"authors": [Sample(10, 1, 8.0, 9.0)], "python": [Sample(20, 1, 4.0, 5.0)]}
    assert ratios(samples, pairs()) == {"authors/python": {"median": 4.0, "low": 4.0, "high": 4.0}}


def test_throughput_is_steps_a_second_of_wall_time():
    two, one = [Sample(200, 2, 1.0, 1.0)], [Sample(100, 1, 1.0, 1.0)]
    assert throughput(two, one)["median"] == pytest.approx(2.0)


@given(st.integers(1, 100_000), st.integers(1, 2000), st.integers(1, 8))
def test_workers_get_equal_shares_of_at_least_the_steps_asked_for(steps, length, workers):
    count = episode_count(steps, length, workers)
    assert count % workers == 0 and count * length >= steps
    assert count - 4 * workers == 0 or (count - 4 * workers) * length < steps


def test_environments_are_named_by_id_or_beginning():
    assert environment_ids(None) == tuple(PAPER)
    assert environment_ids("Hopper, PandaReach-v1,BipedalWalker,Hopper") == (
        "HopperBulletEnv-v0",
        "PandaReach-v3",
        "BipedalWalker-v3",
    )
    for text, word in (("Panda", "could be"), ("Cart", "is none of")):
        with pytest.raises(UsageError, match=word):
            environment_ids(text)


def test_names_are_listed_once():
    assert names(" a,b,,a ") == ("a", "b") and names(None) == ()


@pytest.mark.parametrize("wrong", [{"rounds": 0}, {"steps": 0}, {"environments": ("CartPole-v1",)}])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(UsageError):
        BenchConfig(**wrong)


def test_a_backend_is_one_more_variant():
    known = list(variants())
    assert known[0] == "authors" and known[-1] == "physics" and "python" in known
    assert {name for pair in pairs() for name in pair} <= set(known)


def test_the_table_replaces_the_one_that_a_page_has(tmp_path):
    page = tmp_path / "speed.md"
    write_markdown(page, f"{BEGIN}\nfirst\n{END}\n")
    page.write_text(f"# Speed\n\n{page.read_text()}\n## More\n")
    write_markdown(page, f"{BEGIN}\nsecond\n{END}\n")
    assert page.read_text() == f"# Speed\n\n{BEGIN}\nsecond\n{END}\n\n## More\n"
    page.write_text("# Another page\n")
    with pytest.raises(DrsError, match="go between"):
        write_markdown(page, f"{BEGIN}\nthird\n{END}\n")
    assert page.read_text() == "# Another page\n"
