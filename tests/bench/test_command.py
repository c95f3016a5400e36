"""`drs bench` as a user meets it."""

import json
import math

import pytest

from drs_core.bench.variants import variants
from tests.conftest import drs, refused

TINY = ("--rounds", 2, "--steps", 20)
PEERS = ("authors", "ars", "evotorch", "ros")


@pytest.fixture(scope="module")
def result():
    answer = drs("bench", "--environments", "MountainCar,LunarLander", "--no-updates", *TINY, "--json")
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.count("\n") == 1
    return json.loads(answer.stdout)


def numbers(value):
    """Every number in it."""
    if isinstance(value, dict):
        return [n for part in value.values() for n in numbers(part)]
    if isinstance(value, list):
        return [n for part in value for n in numbers(part)]
    return [value] if isinstance(value, (int, float)) else []


def test_every_variant_is_measured_or_named_with_the_reason(result):
    assert set(result["environments"]) == {"MountainCarContinuous-v0", "LunarLanderContinuous-v3"}
    for environment in result["environments"].values():
        measured, skipped = set(environment["variants"]), environment["skipped"]
        assert measured | set(skipped) == set(variants()) == set(result["titles"])
        assert not measured & set(skipped)
        assert {"python", "workers_1", "workers_2"} <= measured
        assert set(skipped) <= {*PEERS, "physics", "compiled"} and all(len(why) > 20 for why in skipped.values())


def test_figures_are_finite_and_positive(result):
    for environment in result["environments"].values():
        found = numbers(environment)
        assert len(found) > 30 and all(map(math.isfinite, found))
        assert all(n > 0 for key in ("ratios", "throughput") for n in numbers(environment[key]))
        assert environment["worker_memory_mb"] > 0
        for variant in environment["variants"].values():
            assert variant["cpu_us_per_step"] > 0 and variant["wall_s_per_128_rollouts"] > 0
            assert len(variant["cpu_us_per_step_rounds"]) == result["rounds"] == 2
            low, high = min(variant["cpu_us_per_step_rounds"]), max(variant["cpu_us_per_step_rounds"])
            assert low <= variant["cpu_us_per_step"] <= high
            assert variant["steps"] >= 40


def test_ratios_follow_from_the_rounds(result):
    for environment in result["environments"].values():
        assert environment["ratios"]
        for name, ratio in environment["ratios"].items():
            over, under = (environment["variants"][side]["cpu_us_per_step_rounds"] for side in name.split("/"))
            of_rounds = sorted(a / b for a, b in zip(over, under, strict=True))
            assert ratio["low"] == pytest.approx(of_rounds[0])
            assert ratio["median"] == pytest.approx(sum(of_rounds) / 2)
            assert ratio["high"] == pytest.approx(of_rounds[-1])


def test_the_machine_is_described(result):
    machine = result["machine"]
    assert machine["processor"] and machine["cores"] >= 1 and machine["python"].count(".") == 2
    assert {"drs", "numpy", "gymnasium", "pybullet"} <= set(machine["packages"])


def test_people_get_tables_and_a_page(tmp_path):
    page = tmp_path / "figures.md"
    answer = drs("bench", "--environments", "MountainCar", "--variants", "python,physics", *TINY, "--markdown", page)
    assert answer.returncode == 0, answer.stderr
    for words in (
        "CPU time of an environment step",
        "MountainCarContinuous-v0",
        "Left out: physics alone",
        "Python 3.",
    ):
        assert words in answer.stdout and words in page.read_text()
    # whole updates too
    for words in ("objective dimension takes", "search's own work", "Not all of 2 workers"):
        assert words in answer.stdout
    assert "physics alone left out" in answer.stderr
    assert "`drs bench --environments MountainCar --variants python,physics --steps 20 --rounds 2`" in page.read_text()


def test_wrong_use_is_refused():
    refused(drs("bench", "--environments", "CartPole"), "CartPole", "Hopper")
    refused(drs("bench", "--variants", "warp"), "warp", "authors")
    refused(drs("bench", "--rounds", 0), "rounds is 0")
    refused(drs("bench", "--agents", "nowhere"), "no folder nowhere")
    refused(drs("bench", "--csv", "cost.csv"), "--csv does nothing without --sample-cost; add that.")
    refused(drs("bench", "--sample-cost", "--no-updates"), "does nothing with --sample-cost; leave one out.")
