"""Rollouts until a goal: kept line by line, and the same however often it was interrupted."""

from __future__ import annotations

import csv
import json
import re
import signal
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from drs_core.bench.sample_cost.agents import Subject, subjects
from drs_core.bench.sample_cost.config import SampleCostConfig
from drs_core.bench.sample_cost.counting import ended
from drs_core.bench.sample_cost.figure import draw
from drs_core.bench.sample_cost.goal import Return, Smooth
from drs_core.bench.sample_cost.job import Job
from drs_core.bench.sample_cost.looks import due, look_seeds
from drs_core.bench.sample_cost.methods import METHODS
from drs_core.bench.sample_cost.summary import result
from drs_core.bench.sample_cost.tables import csv_text, sentences
from drs_core.episode import Episode
from drs_core.errors import UsageError
from drs_core.measures.smoothness import TipMotion
from drs_core.search import episode_seed
from tests.conftest import drs, make_agent, refused


def a_job(path: Path, goal: float = 1e9, most: int = 48, method: str = "top4") -> Job:
    # its episodes last a millisecond
    return Job(make_agent("Pendulum-v1", (4,)), Return(goal), METHODS[method], 1, most, "python", path)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> bytes:
    job = a_job(tmp_path_factory.mktemp("whole") / "0.jsonl")
    assert job.run()
    return job.path.read_bytes()


def test_records_are_updates_and_looks(whole: bytes):
    head, *records = map(json.loads, whole.splitlines())
    assert head["settings"]["kind"] == "direct" and head["goal"] == {"value": 1e9}
    assert [r["rollouts"] for r in records if "objectives" in r] == [16, 32, 48]
    looks = [r for r in records if "reached" in r]
    assert [look["rollouts"] for look in looks] == [0, 32, 48] and not any(look["reached"] for look in looks)
    # far from the goal, twenty episodes tell enough
    assert all(len(look["returns"]) == 20 and look["shown"] == np.mean(look["returns"]) for look in looks)


def test_evaluations_that_steer_are_counted(tmp_path: Path):
    job = a_job(tmp_path / "0.jsonl", most=250, method="frugal")
    assert job.run() and ended(job.records(), 250)
    counts = [r["rollouts"] for r in job.records() if "objectives" in r]
    assert counts == [36 + 16 * i for i in range(10)] + [216]
    content = job.path.read_bytes()
    lines = content.splitlines(keepends=True)
    for left in (2, len(lines) - 1):
        job.path.write_bytes(b"".join(lines[:left]))
        assert job.run() and job.path.read_bytes() == content


def test_cut_off_anywhere_it_goes_on_to_the_same(whole: bytes, tmp_path: Path):
    job = a_job(tmp_path / "0.jsonl")
    ends = [place + 1 for place, byte in enumerate(whole) if byte == ord("\n")]
    for end in [*ends[:-1], ends[1] - 5, ends[-1] - 5]:
        job.path.write_bytes(whole[:end])
        assert not ended(job.records(), job.most)
        assert job.run()
        assert job.path.read_bytes() == whole
    assert job.run() and job.path.read_bytes() == whole


def test_a_smaller_budget_loses_nothing(whole: bytes, tmp_path: Path):
    job = a_job(tmp_path / "0.jsonl")
    job.path.write_bytes(whole)
    less = replace(job, most=32)
    assert less.run() and ended(less.records(), 32) and job.path.read_bytes() == whole
    subject = Subject("pendulum", job.agent, job.goal, "python")
    # seed 0 has not begun
    waiting = replace(less, seed=0, path=tmp_path / "other.jsonl")
    found = result(SampleCostConfig(methods=("top4",), seeds=2), [subject], [], [waiting, less])
    assert csv_text(found).splitlines()[1] == "pendulum,1000000000.0,top4,1,,32"
    searches = found["agents"]["pendulum"]["methods"]["top4"]
    assert searches["costs"] == [None] and searches["most"] == 32 and searches["curves"][1][-1][0] == 32
    # the newest record is then an update beyond it, or a look
    assert less.said() == "not reached after 32 rollouts"
    job.path.write_bytes(b"".join(whole.splitlines(keepends=True)[:-1]))
    assert "objectives" in less.records()[-1] and less.said() == "not reached after 32 rollouts"


def test_a_goal_within_reach_ends_it(tmp_path: Path):
    job = a_job(tmp_path / "0.jsonl", goal=-1e9)
    assert job.run() and ended(job.records(), job.most)
    _, look = job.records()
    assert look["reached"] and look["rollouts"] == 0 and len(look["returns"]) == 100
    assert "reached after 0 rollouts" in job.said()


def test_time_that_is_over_ends_it_between_updates(tmp_path: Path):
    job = a_job(tmp_path / "0.jsonl")
    assert not job.run(until=0.0)
    assert job.said() == "0 rollouts so far"


def test_time_that_is_over_replays_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    assert a_job(tmp_path / "0.jsonl", most=16).run()

    def replayed(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(Job, "_replayed", replayed)
    assert not a_job(tmp_path / "0.jsonl").run(until=0.0)


@pytest.mark.parametrize("linked", ["MountainCar-ppo/frugal", "MountainCar-ppo"])
def test_nothing_is_written_through_a_linked_folder(tmp_path: Path, linked: str):
    notes = tmp_path / "mine" / "frugal" / "0.jsonl"
    notes.parent.mkdir(parents=True)
    notes.write_text("no line end")
    link = tmp_path / "out" / linked
    link.parent.mkdir(parents=True)
    link.symlink_to(notes.parents[0 if link.name == "frugal" else 1])
    with pytest.raises(UsageError, match="is a link"):
        a_job(tmp_path / "out" / "MountainCar-ppo" / "frugal" / "0.jsonl").run()
    assert notes.read_text() == "no line end" and len([*notes.parent.iterdir()]) == 1


def test_an_agent_that_cannot_be_read_is_not_taken_for_none(tmp_path: Path):
    folder = tmp_path / "ppo" / "MountainCarContinuous-v0_1"
    folder.mkdir(parents=True)
    (folder / "MountainCarContinuous-v0.zip").write_text("version https://git-lfs.github.com/spec/v1")
    refused(
        drs("bench", "--sample-cost", "--agents", tmp_path, "--rows", "MountainCar", "--output", tmp_path / "o"), "zip"
    )
    refused(drs("reproduce", "I", "--agents", tmp_path, "--rows", "MountainCar", "--output", tmp_path / "r"), "zip")


def test_records_of_another_search_are_refused(whole: bytes, tmp_path: Path):
    job = a_job(tmp_path / "0.jsonl", method="all")
    job.path.write_bytes(whole)
    with pytest.raises(UsageError, match="another agent, goal, backend or setting"):
        job.run()
    assert job.path.read_bytes() == whole


def test_looks_are_apart_from_the_search_and_rarer_with_time():
    looked, looks = -1, []
    for done in range(0, 5121, 16):
        if due(looked, done):
            looks.append(looked := done)
    assert looks[:6] == [0, 32, 64, 96, 128, 160] and len(looks) < 25
    assert all(b < max(1.25 * a, a + 32) + 16 for a, b in pairwise(looks))
    seeds = [set(look_seeds(0, done)) for done in (0, 32, 64)]
    searched = {episode_seed(0, update, index) for update in range(50) for index in range(8)}
    assert len(set.union(*seeds, searched)) >= 3 * 100 + len(searched) - 2


def an_episode(return_: float = -2.0, speed: float = 0.3, jerk: float = 1e6, success: bool = True) -> Episode:
    motion = TipMotion(speed, jerk, 0.0, 0.0, 0.0)
    return Episode(0, return_, 50, False, False, success, 0.1, motion=motion)


def test_goals():
    spread = [an_episode(return_) for return_ in np.linspace(80, 100, 100)]
    assert Return(88.0).reached(spread) and not Return(89.9).reached(spread)
    assert Return(120.0).out_of_reach(spread[:20]) and not Return(89.9).out_of_reach(spread)
    smooth = Smooth.of([an_episode(return_) for return_ in np.linspace(-3, -1, 100)])
    assert smooth.reached([an_episode(-2.0, 0.02, 2e4)] * 100)
    for bad in (an_episode(-2.0, 0.021, 2e4), an_episode(-2.0, 0.02, 2.1e4), an_episode(-2.5, 0.02, 2e4)):
        assert not smooth.reached([bad] * 100)
    failed = [an_episode(-2.0, 0.02, 2e4)] * 99 + [an_episode(-2.0, 0.02, 2e4, False)]
    assert not smooth.reached(failed) and smooth.out_of_reach(failed)
    assert smooth.out_of_reach([an_episode()] * 20) and not smooth.out_of_reach([an_episode(-2.0, 0.05, 5e4)] * 20)


def test_the_command_line_goes_on_where_it_was_interrupted(shared: Path, tmp_path: Path):
    asked = ["bench", "--sample-cost", "--agents", shared / "agents", "--rows", "MountainCar-ddpg,MountainCar-td3"]
    asked += ["--methods", "frugal,all", "--seeds", 1, "--rollouts", 64, "--output", tmp_path / "out", "--workers", 2]
    begun = subprocess.Popen([sys.executable, "-m", "drs_core.cli", *map(str, asked)], stderr=subprocess.PIPE)
    while not list(tmp_path.glob("out/*/frugal/0.jsonl")):
        assert begun.poll() is None
    begun.send_signal(signal.SIGTERM)
    assert begun.wait(timeout=60) != 0 and b"Traceback" not in begun.stderr.read()
    result = drs(*asked, "--json", "--figure", tmp_path / "f.svg", "--csv", tmp_path / "c.csv", timeout=300)
    assert result.returncode == 0, result.stderr
    told = json.loads(result.stdout)
    assert told["missing"] == ["MountainCar-td3"] and list(told["agents"]) == ["MountainCar-ddpg"]
    for found in told["agents"]["MountainCar-ddpg"]["methods"].values():
        assert found["ended"] == 1 and found["curves"][0][0][0] == 0
    lines = list(csv.DictReader((tmp_path / "c.csv").open()))
    assert [line["method"] for line in lines] == ["frugal", "all"] and lines[0]["most"] == "64"
    assert b"MountainCar-ddpg" in (tmp_path / "f.svg").read_bytes()
    again = drs(*asked, timeout=120)
    assert "> 64" in again.stdout or "64" in again.stdout


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--methods", "magic", "no method 'magic'"),
        ("--methods", " ,", "No method is named; choose some of paper, frugal"),
        ("--seeds", 0, "seeds is 0"),
        ("--rollouts", 2, "the first update of paper takes 128"),
        ("--rows", "Mars", "No row is called 'Mars'; there are 1 to 47"),
        ("--rows", ",", "--rows ',' names no row; there are 1 to 47"),
        ("--rows", "", "--rows '' names no row"),
    ],
)
def test_wrong_use_is_told(option: str, value: object, said: str):
    result = drs("bench", "--sample-cost", option, value)
    assert result.returncode == 2 and said in result.stderr and "Traceback" not in result.stderr


def test_a_number_is_a_row_of_table_i():
    def rows(asked: str | None) -> list[str]:
        found, missing = subjects(SampleCostConfig(rows=asked))
        return [*(subject.name for subject in found), *missing]

    # the arm is the first row of another table
    assert rows("PandaReach, 1") == ["PandaReach-tqc", "MountainCar-a2c"]
    with pytest.raises(UsageError, match="None of these rows has an agent"):
        rows("1")


@pytest.mark.parametrize(
    ("ended", "said"), [(0, "2 searches have not come to their"), (1, "1 search has not come to its")]
)
def test_searches_that_wait_are_counted(ended: int, said: str):
    agents = {"agent": {"methods": {"frugal": {"ended": ended}}}}
    assert any(said in line for line in sentences({"rollouts": 64, "seeds": 2, "agents": agents, "missing": []}))


def test_the_figure_draws_every_method(tmp_path: Path):
    goal = {"objective": "return", "label": "return", "line": 5.0}
    drawn = {method: {"curves": [[], [[0, 1.0], [32, 6.0 + place]]]} for place, method in enumerate(METHODS)}
    # in the first panel, one of which no search has begun
    agents = {"waiting": drawn | {"paper": {"curves": [[]]}}, "agent": drawn}
    titles = {method: f"title-{method}" for method in METHODS}
    result = {"titles": titles, "agents": {name: {"goal": goal, "methods": found} for name, found in agents.items()}}
    draw(result, tmp_path / "cost.svg")
    content = (tmp_path / "cost.svg").read_text()
    # text is drawn as paths, after a comment that holds it
    assert all(f"<!-- {title} -->" in content for title in titles.values())
    second = content[content.index('<g id="axes_2">') : content.index('<g id="legend_1">')]
    lines = re.findall(r'clip-path="[^"]*" style="fill: none; ([^"]*opacity: 0.8[^"]*)"', second)
    assert len(lines) == len(set(lines)) == len(METHODS)


def test_the_figure_has_a_panel_an_agent_and_no_more(tmp_path: Path):
    goal = {"objective": "return", "label": "return", "line": 5.0}
    found = {"curves": [[[0, 1.0], [32, 6.0]]]}
    agents = {f"agent{i}": {"goal": goal, "methods": {"frugal": found}} for i in range(5)}
    draw({"titles": {"frugal": "frugal"}, "agents": agents}, tmp_path / "cost.svg")
    assert len(re.findall(rb'<g id="axes_\d+">', (tmp_path / "cost.svg").read_bytes())) == 5
