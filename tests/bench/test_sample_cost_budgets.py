"""What a budget tells is the same, whichever others were asked in the folder before."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from drs_core.bench.sample_cost.agents import Subject
from drs_core.bench.sample_cost.config import SampleCostConfig
from drs_core.bench.sample_cost.counting import ended, within
from drs_core.bench.sample_cost.job import Job
from drs_core.bench.sample_cost.methods import METHODS
from drs_core.bench.sample_cost.summary import result
from drs_core.errors import UsageError
from tests.bench.test_sample_cost import a_job


def told(job: Job) -> str:
    """The result as text."""
    config = SampleCostConfig(methods=("top4",), seeds=1, rollouts=job.most)
    return json.dumps(result(config, [Subject("pendulum", job.agent, job.goal, "python")], [], [job]))


def looks(job: Job) -> list[int]:
    return [record["rollouts"] for record in job.records() if "reached" in record]


def edited(job: Job, keep) -> None:
    """Leave only the lines whose record is to be kept."""
    lines = job.path.read_bytes().splitlines(keepends=True)
    job.path.write_bytes(b"".join(line for line in lines if keep(json.loads(line))))


@pytest.fixture(scope="module")
def fresh(tmp_path_factory):
    """A job that has ended, budget by budget, each in a folder of its own."""
    jobs: dict[int, Job] = {}

    def ended_within(most: int) -> Job:
        if most not in jobs:
            jobs[most] = a_job(tmp_path_factory.mktemp("fresh") / "0.jsonl", most=most)
            assert jobs[most].run()
        return jobs[most]

    return ended_within


@pytest.mark.parametrize("budgets", [(48, 96), (96, 48), (100, 50, 128), (128, 20, 48, 112)])
def test_the_order_of_budgets_changes_nothing(budgets: tuple[int, ...], fresh, tmp_path: Path):
    for most in budgets:
        job = a_job(tmp_path / "0.jsonl", most=most)
        assert job.run() and told(job) == told(fresh(most)) and job.said() == fresh(most).said()
    for most in budgets:
        assert told(replace(job, most=most)) == told(fresh(most))


def test_a_look_that_is_missing_is_put_in_its_place(fresh, tmp_path: Path):
    wanted = fresh(96)
    assert looks(wanted) == [0, 32, 64, 96]
    # as an earlier version left it, whose look at an end of 48 had moved those after it
    job = replace(wanted, path=tmp_path / "0.jsonl")
    job.path.write_bytes(wanted.path.read_bytes())
    edited(job, lambda record: "reached" not in record or record["rollouts"] != 64)
    assert not ended(job.records(), 96) and not job.run(until=0.0)
    (tmp_path / ".0.jsonl.1.tmp").write_bytes(b"left by a process that was killed")
    assert job.run() and job.path.read_bytes() == wanted.path.read_bytes()
    assert list(tmp_path.iterdir()) == [job.path]


def test_the_end_of_a_smaller_budget_ends_no_larger_one(fresh, tmp_path: Path):
    less = replace(fresh(48), path=tmp_path / "0.jsonl")
    less.path.write_bytes(fresh(48).path.read_bytes().replace(b'48, "reached": false', b'48, "reached": true'))
    assert less.said() == "reached after 48 rollouts"
    more = replace(less, most=96)
    assert not ended(more.records(), 96) and more.run() and told(more) == told(fresh(96))
    assert less.said() == "reached after 48 rollouts"


def test_what_counts():
    def update(done: int) -> dict:
        return {"rollouts": done, "objectives": [0.0] * 16}

    def look(done: int, reached: bool = False) -> dict:
        return {"rollouts": done, "reached": reached, "shown": 0.0, "returns": [0.0]}

    head = {"rollouts": 0}
    assert within([], 64).missing == within([head], 64).missing == 0
    records = [head, look(0), update(16), update(32), look(32), update(48), look(48, True), update(64)]
    for most, counting, missing, done, end in (
        (31, [0], 16, 16, False),
        (47, [0, 32], None, 32, True),
        (48, [0, 32, 48], None, 48, True),
        (64, [0, 32], 64, 64, False),
    ):
        found = within(records, most)
        assert [record["rollouts"] for record in found.looks] == counting
        assert (found.missing, found.done, found.ended) == (missing, done, end)
    # what came after the goal does not count
    reached = within([head, look(0), update(16), update(32), look(32, True), update(48), look(48)], 48)
    assert reached.ended and reached.done == 32 and len(reached.looks) == 2


@pytest.mark.parametrize("name", METHODS)
def test_a_budget_below_one_update_is_refused(name: str):
    least = METHODS[name].first
    with pytest.raises(UsageError, match=rf"rollouts is {least - 1}, and the first update of {name} takes {least}"):
        SampleCostConfig(methods=(name,), rollouts=least - 1)
    assert SampleCostConfig(methods=(name,), rollouts=least).rollouts == least
