"""A search's file that is damaged is told of in a sentence, and left as it is."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from drs_core.bench.sample_cost.job import Job
from drs_core.errors import UsageError
from tests.bench.test_sample_cost import a_job

UPDATE, LOOK = 2, -1
"""Places of an update and of the look after the last one."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> list[dict[str, Any]]:
    job = a_job(tmp_path_factory.mktemp("whole") / "0.jsonl")
    assert job.run()
    return job.records()


def kept(path: Path, records: list[Any]) -> Job:
    path.write_text("".join(json.dumps(record) + "\n" for record in records))
    return a_job(path)


def refused(job: Job, said: str) -> None:
    before = job.path.read_bytes()
    for act in (job.run, job.records, job.said):
        with pytest.raises(UsageError, match=said) as caught:
            act()
        assert str(job.path) in str(caught.value) and "elete the file" in str(caught.value)
    assert job.path.read_bytes() == before


def objectives(change: Callable[[list[float]], Any]) -> Callable[[dict[str, Any]], dict[str, Any]]:
    return lambda record: record | {"objectives": change(record["objectives"])}


@pytest.mark.parametrize(
    ("place", "change", "said"),
    [
        (UPDATE, objectives(lambda o: [str(o[0]), *o[1:]]), "Line 3 .* objectives is .* not a list of finite numbers"),
        (UPDATE, objectives(lambda o: [None, *o[1:]]), "not a list of finite numbers"),
        (UPDATE, objectives(lambda o: [True, *o[1:]]), "not a list of finite numbers"),
        (UPDATE, objectives(lambda o: [10**400, *o[1:]]), "not a list of finite numbers"),
        (UPDATE, objectives(lambda o: [[value] for value in o]), "not a list of finite numbers"),
        (UPDATE, objectives(lambda o: "x" * len(o)), "not a list of finite numbers"),
        (UPDATE, objectives(lambda o: []), "not a list of finite numbers"),
        (UPDATE, objectives(lambda o: o[:-1]), "rollouts is 16, where 15 are done"),
        (UPDATE, objectives(lambda o: [*o, 0.0]), "rollouts is 16, where 17 are done"),
        (UPDATE, lambda r: r | {"rollouts": -16}, "rollouts is -16, where 16 are done"),
        (UPDATE, lambda r: r | {"rollouts": True}, "rollouts is True"),
        (UPDATE, lambda r: r | {"rollouts": "16"}, "no whole number 'rollouts'"),
        (UPDATE, lambda r: {"rollouts": 16}, r"the keys \['rollouts'\]"),
        (UPDATE, lambda r: r | {"reached": False}, "the keys"),
        (UPDATE, lambda r: None, "is not a record"),
        (UPDATE, lambda r: "update", "is not a record"),
        (LOOK, lambda r: r | {"reached": "no"}, "reached is 'no', not true or false"),
        (LOOK, lambda r: r | {"reached": 0}, "reached is 0"),
        (LOOK, lambda r: r | {"shown": None}, "shown is None, not a finite number"),
        (LOOK, lambda r: r | {"returns": [[1.0]]}, "returns is"),
        (LOOK, lambda r: r | {"rollouts": 32}, "rollouts is 32, where 48 are done"),
        (LOOK, lambda r: {key: value for key, value in r.items() if key != "shown"}, "the keys"),
        (0, lambda r: r | {"backend": None}, "another agent, goal, backend or setting"),
    ],
)
def test_a_damaged_record_is_told_of(whole, tmp_path: Path, place: int, change: Callable, said: str):
    records = [*whole]
    records[place] = change(records[place])
    refused(kept(tmp_path / "0.jsonl", records), said)


def test_records_out_of_order_are_told_of(whole, tmp_path: Path):
    # as two processes leave them that write the same file
    update = next(place for place, record in enumerate(whole) if "objectives" in record)
    refused(kept(tmp_path / "0.jsonl", [*whole[: update + 1], *whole[update:]]), "rollouts is 16, where 32 are done")
    refused(kept(tmp_path / "0.jsonl", [*whole, whole[LOOK]]), "a second look after 48 rollouts")
    refused(kept(tmp_path / "0.jsonl", [whole[0], *whole]), "the keys")


@pytest.mark.parametrize("count", [2, 15, 17, 18])
def test_objectives_that_a_search_does_not_value_are_told_of(whole, tmp_path: Path, count: int):
    update = {"rollouts": count, "objectives": [0.5] * count}
    job = kept(tmp_path / "0.jsonl", [*whole[:2], update])
    with pytest.raises(UsageError, match=r"not as many as the search values\. Delete the file"):
        job.run()


@pytest.mark.parametrize("exists", [True, False])
def test_nothing_is_written_through_a_link(whole, tmp_path: Path, exists: bool):
    target = tmp_path / "elsewhere.jsonl"
    if exists:
        kept(target, whole[:1])
    before = target.read_bytes() if exists else None
    job = a_job(tmp_path / "0.jsonl")
    job.path.symlink_to(target)
    with pytest.raises(UsageError, match="is a link, and nothing is written through it"):
        job.run()
    assert (target.read_bytes() if exists else None) == before and target.exists() == exists
