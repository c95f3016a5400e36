"""Rows on disk: kept, continued, refused where they do not fit."""

import json
import shutil

import pytest

from drs_core.agent import load
from drs_core.errors import UsageError
from drs_core.reproduce import job as job_module
from drs_core.reproduce.config import ReproduceConfig
from drs_core.reproduce.grid import prepare
from drs_core.reproduce.job import AFTER, BEFORE, Job
from drs_core.reproduce.kept import keep, read
from drs_core.reproduce.lookup import Baseline, find
from drs_core.reproduce.paper import paper_rows
from drs_core.reproduce.stopping import PATIENCE, UNFINISHED, UPDATES
from drs_core.rollouts import InProcess
from drs_core.versions import Part, installed
from tests.conftest import make_agent


class Silent:
    def on_row(self, job):
        pass

    def on_evaluate(self, row, stage, episodes):
        return lambda done: None

    def on_other_versions(self, sentence):
        pass

    def on_rollouts(self, update, done, total):
        pass

    def on_update(self, record):
        pass

    def on_evaluation(self, record):
        pass


@pytest.fixture(scope="module")
def baseline():
    """An agent that ends its episodes soon would be quicker; this one is random, and never arrives."""
    return Baseline("random", make_agent(hidden=(2,)))


def row(name="MountainCar-a2c", table="I"):
    return next(row for row in paper_rows(table) if row.name == name)


def test_more_episodes_are_added_and_fewer_are_a_part(tmp_path):
    agent = make_agent(hidden=(2,))
    with_pool = InProcess(agent)
    keep(tmp_path / "a.json", agent, "python", with_pool, 2)
    grown = keep(tmp_path / "a.json", agent, "python", with_pool, 4)
    at_once = keep(tmp_path / "b.json", agent, "python", with_pool, 4)
    assert grown.columns == at_once.columns and grown.episodes == 4
    stamp = (tmp_path / "a.json").stat().st_mtime_ns
    assert keep(tmp_path / "a.json", agent, "python", with_pool, 3).columns == grown.columns
    assert (tmp_path / "a.json").stat().st_mtime_ns == stamp
    other = make_agent(hidden=(2,), seed=1)
    assert keep(tmp_path / "a.json", other, "python", with_pool, 2).episodes == 2
    with_pool.close()


@pytest.mark.parametrize(
    "damage",
    [b"", b"{", b"[]", b"null", b'{"digest": 1}', b'{"digest":"a","backend":"b","wall_s":1,"columns":{"return":[1]}}'],
)
def test_a_damaged_evaluation_is_named(tmp_path, damage):
    path = tmp_path / "before.json"
    path.write_bytes(damage)
    with pytest.raises(UsageError, match=r"before\.json"):
        read(path)


def test_what_ran_the_episodes_is_kept_with_them(tmp_path, monkeypatch):
    agent, path = make_agent(hidden=(2,)), tmp_path / "a.json"
    runs, here = InProcess(agent), installed()
    there = {**here, "numpy": "1.26.0"}

    def under(versions, episodes):
        monkeypatch.setattr("drs_core.versions.installed", lambda: versions)
        assert keep(path, agent, "python", runs, episodes) == read(path)
        return list(read(path).made_with)

    assert under(there, 2) == under(here, 1) == [Part(0, there)]
    assert under(here, 3) == under(here, 4) == [Part(0, there), Part(2, here)]
    content = json.loads(path.read_text())
    for wrong in ([], None, [3], [{"versions": here}]):
        path.write_text(json.dumps(content | {"made_with": wrong}))
        with pytest.raises(UsageError, match=r"a\.json is damaged"):
            read(path)
    # as an earlier version has left it
    del content["made_with"]
    path.write_text(json.dumps(content))
    assert under(here, 4) == [Part(0, {})] and path.read_text() == json.dumps(content)
    assert under(here, 5) == [Part(0, {}), Part(4, here)]
    runs.close()


def test_agents_are_found_by_old_names_then_among_the_shipped(shared, tmp_path):
    assert find(row("LunarLander-ddpg"), shared / "agents").name == "ddpg/LunarLanderContinuous-v2_1"
    reach = row("PandaReach-tqc", "IV")
    assert find(reach, shared / "agents").name == "tqc/PandaReach-v1_1"
    assert find(reach, None).name == find(reach, tmp_path).name == "panda_reach"
    for algorithm, number in (("ppo", 3), ("a2c", 20)):
        source = shared / "agents" / algorithm / "MountainCarContinuous-v0_1"
        shutil.copytree(source, tmp_path / "a2c" / f"MountainCarContinuous-v0_{number}")
    assert find(row(), tmp_path).name == "a2c/MountainCarContinuous-v0_20"
    with pytest.raises(UsageError, match="no td3 agent of AntBulletEnv-v0"):
        find(row("Ant-td3"), shared / "agents")


def test_an_agent_that_cannot_be_read_is_skipped_with_the_reason(shared, tmp_path):
    (tmp_path / "a2c" / "MountainCarContinuous-v0_1").mkdir(parents=True)
    shutil.copytree(shared / "agents" / "ppo", tmp_path / "ppo")
    rows = [row(), row("MountainCar-ppo")]
    jobs, skipped = prepare(rows, ReproduceConfig("I", agents=tmp_path, output=tmp_path / "out"))
    assert [job.row.name for job in jobs] == ["MountainCar-ppo"]
    assert "holds no Stable-Baselines3 zip" in skipped["MountainCar-a2c"]
    assert not (tmp_path / "out").exists()


def settings(path, **more):
    return ReproduceConfig("I", output=path, episodes=2, workers=0, **more)


def test_a_turn_that_comes_too_late_makes_one_update_and_is_concluded(tmp_path, baseline):
    job = Job(row(), baseline, settings(tmp_path))
    assert not job.whole() and job.done() == 0 and job.tuned() is None
    job.work(Silent(), until=0.0)
    assert (job.done(), job.stop_reason()) == (1, UNFINISHED)
    assert job.evaluated(BEFORE) and not job.evaluated(AFTER) and job.evaluation_s() > 0
    job.conclude(Silent())
    assert job.evaluated(AFTER) and job.evaluation_s() == 0 and not job.whole()
    tuned = job.tuned()
    assert (tuned.which, tuned.update) == ("newest", 1)
    # asked for no more than there is, it is whole; asked for more, its evaluation is out of date
    assert Job(row(), baseline, settings(tmp_path, updates=1)).whole()
    with pytest.raises(UsageError, match="of another MountainCar-a2c agent"):
        Job(row(), Baseline("other", make_agent(hidden=(3,))), settings(tmp_path))
    settings_file = tmp_path / "MountainCar-a2c" / "return-0" / "run.json"
    settings_file.write_text(settings_file.read_text().replace('"python"', '"compiled"', 1))
    with pytest.raises(UsageError, match="begun with --backend compiled and python"):
        Job(row(), baseline, settings(tmp_path))


def test_a_row_that_goes_on_under_other_versions_says_so_and_names_both(tmp_path, baseline, monkeypatch):
    here, told = installed(), []
    there = {**here, "numpy": "1.26.0"}
    watcher = Silent()
    watcher.on_other_versions = told.append
    job = Job(row(), baseline, settings(tmp_path, updates=2))
    assert job.made_with() == {}
    for place in ("drs_core.versions.installed", "drs_core.tuning.installed"):
        monkeypatch.setattr(place, lambda: there)
    job.work(watcher, until=0.0)
    assert job.made_with() == {"tuning": [Part(0, there)], "before": [Part(0, there)]} and told == []
    monkeypatch.undo()
    job.work(watcher)
    assert job.made_with() == {
        "tuning": [Part(0, there), Part(1, here)],
        "before": [Part(0, there)],
        "after": [Part(0, here)],
    }
    assert len(told) == 1 and f"numpy {here['numpy']} (before: 1.26.0)" in told[0]
    # the episodes that are asked for are the first ones
    more = ReproduceConfig("I", output=tmp_path, episodes=3, workers=0, updates=2)
    Job(row(), baseline, more).work(watcher)
    assert Job(row(), baseline, more).made_with()["before"] == [Part(0, there), Part(2, here)]
    assert job.made_with()["before"] == [Part(0, there)]


def test_patience_ends_a_run_between_two_updates_and_it_can_go_on(shared, tmp_path, monkeypatch):
    baseline = find(row(), shared / "agents")
    with monkeypatch.context() as patched:
        patched.setattr(job_module, "stalled", lambda records, patience: len(records) == 2)
        impatient = Job(row(), baseline, settings(tmp_path / "a", updates=11, patience=10))
        impatient.work(Silent())
        assert impatient.done() == 10 and len(impatient.history()) == 10
        impatient.conclude(Silent())
        records = [json.loads(line) for line in (impatient.path / "evaluations.jsonl").read_text().splitlines()]
        assert [record["update"] for record in records] == [0, 10]
        best = max(records, key=lambda record: record["objective_mean"])
        assert (impatient.tuned().which, impatient.tuned().update) == ("best", best["update"])
        assert impatient.evaluated(AFTER).digest == load(impatient.path / "best.safetensors").digest()
    assert impatient.stop_reason() == (PATIENCE if best["update"] == 0 else UNFINISHED)
    onward, straight = (Job(row(), baseline, settings(tmp_path / name, updates=11)) for name in "ab")
    for job in (onward, straight):
        job.work(Silent())
        assert job.stop_reason() == UPDATES and job.whole()
    for name in ("agent.safetensors", "best.safetensors", "evaluations.jsonl"):
        assert (onward.path / name).read_bytes() == (straight.path / name).read_bytes()
