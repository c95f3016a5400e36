"""Which versions made a run: kept and told where a resume changes them, and nothing where it does not."""

import json
from dataclasses import replace

import pytest

from drs_core import versions
from drs_core.errors import UsageError
from drs_core.rollouts import InProcess
from drs_core.tuning import Tuning
from drs_core.versions import Part, elsewhere, installed, listed, others
from tests.conftest import drs
from tests.test_tuning import CONFIG, Silent, same, tune

HERE = installed()
ELSEWHERE = {**HERE, "numpy": "1.26.0", "pybullet": "3.2.5"}


@pytest.fixture
def under(monkeypatch):
    """Called with versions: runs begin and go on with these."""

    def other(now):
        for place in ("drs_core.versions.installed", "drs_core.tuning.installed"):
            monkeypatch.setattr(place, lambda: now)

    return other


def resumed(agent, path, stop_after=None, config=CONFIG):
    """Go on with a run; what it tells."""
    told = []
    tuning = Tuning(agent, "agent", config, path, resume=True, tell=told.append)
    tuning.run(InProcess(agent), Silent(), stop_after)
    return told


def kept(path):
    return json.loads((path / "run.json").read_text())


def test_what_differs_is_named_with_all_versions_once():
    now = {"drs": "1", "numpy": "2", "new": "5"}
    parts = [Part(0, {"drs": "1", "numpy": "1", "gone": "3"}), Part(4, {"numpy": "1.5"}), Part(6, {"numpy": "1"})]
    assert elsewhere(parts, now) == {"numpy": ["1", "1.5"], "gone": ["3"]}
    assert others(parts, now, "run") == ["numpy 2 (run: 1 and 1.5)", "gone not installed (run: 3)"]
    assert others([Part(0, now)], now, "run") == others([Part(0, {})], now, "run") == []
    assert [listed(list(words)) for words in ("", "a", "ab", "abc")] == ["", "a", "a and b", "a, b and c"]


def test_parts_come_back_from_a_file_as_they_were_kept():
    parts = [Part(0, {}), Part(3, {"numpy": "2"})]
    assert versions.read(versions.kept(parts, "update"), "update") == parts
    for wrong in (None, {}, [1], [{}], [{"update": True}], [{"update": -1}], [{"update": "1"}], [{"episode": 1}]):
        assert versions.read(wrong, "update") is None
    assert versions.read([{"update": 1, "versions": {"a": 1, "b": "2"}}], "update") == [Part(1, {"b": "2"})]


def test_a_resume_under_other_versions_goes_on_tells_and_keeps_it(agent, tmp_path, under):
    straight, path = tmp_path / "straight", tmp_path / "run"
    tune(agent, straight)
    begun = kept(straight)
    tune(agent, path, stop_after=2)
    under(ELSEWHERE)
    assert resumed(agent, path, 4) == [
        f"{path} goes on with numpy 1.26.0 (before: {HERE['numpy']}) and pybullet 3.2.5 (before: {HERE['pybullet']}): "
        "its results may differ from those of a run with one set of versions."
    ]
    one = {"update": 2, "versions": ELSEWHERE}
    assert kept(path) == begun | {"resumed_with": [one]}
    # it stays a run of two sets, and is told of, but nothing new is kept
    assert len(resumed(agent, path, 5)) == 1 and kept(path) == begun | {"resumed_with": [one]}
    under(HERE)
    assert resumed(agent, path) == [
        f"{path} goes on with numpy {HERE['numpy']} (before: 1.26.0) and pybullet {HERE['pybullet']} (before: 3.2.5): "
        "its results may differ from those of a run with one set of versions."
    ]
    assert kept(path) == begun | {"resumed_with": [one, {"update": 5, "versions": HERE}]}
    # with nothing left to make, nothing is told or kept
    under({**HERE, "numpy": "0.1"})
    before = (path / "run.json").read_bytes()
    assert resumed(agent, path) == [] and (path / "run.json").read_bytes() == before
    (path / "run.json").write_text(json.dumps(begun))
    same(path, straight)


def test_a_last_evaluation_that_is_still_to_come_counts(agent, tmp_path, under):
    tune(agent, tmp_path)
    lines = (tmp_path / "evaluations.jsonl").read_text().splitlines(keepends=True)
    (tmp_path / "evaluations.jsonl").write_text("".join(lines[:-1]))
    under(ELSEWHERE)
    assert len(resumed(agent, tmp_path)) == 1
    assert kept(tmp_path)["resumed_with"] == [{"update": 6, "versions": ELSEWHERE}]


def test_under_the_same_versions_nothing_is_told_and_run_json_stays_as_it_is(agent, tmp_path):
    config = replace(CONFIG, search=replace(CONFIG.search, updates=2))
    tune(agent, tmp_path, stop_after=1, config=config)
    before = (tmp_path / "run.json").read_bytes()
    assert resumed(agent, tmp_path, config=config) == []
    assert (tmp_path / "run.json").read_bytes() == before


def test_versions_that_have_made_nothing_are_not_kept(agent, tmp_path, under, monkeypatch):
    tune(agent, tmp_path, stop_after=2)
    before = (tmp_path / "run.json").read_bytes()
    under(ELSEWHERE)

    class Interrupted(InProcess):
        def run(self, *_):
            raise KeyboardInterrupt

    told = []
    tuning = Tuning(agent, "agent", CONFIG, tmp_path, resume=True, tell=told.append)
    with pytest.raises(KeyboardInterrupt):
        tuning.run(Interrupted(agent), Silent())
    assert len(told) == 1 and (tmp_path / "run.json").read_bytes() == before
    under(HERE)
    assert resumed(agent, tmp_path, 3) == [] and (tmp_path / "run.json").read_bytes() == before
    # nor those of a resume that finds that the run had gone flat
    under(ELSEWHERE)
    monkeypatch.setattr("drs_core.tuning.Tuning._is_flat", lambda self, *_: True)
    flat = Tuning(agent, "agent", CONFIG, tmp_path, resume=True, tell=told.append)
    flat._stop_when_flat = True
    due = len(flat._evaluation_tasks())
    flat.run(InProcess(agent) if due else Interrupted(agent), Silent())
    assert (len(told) == 1) is not bool(due)


def test_what_made_a_run_that_does_not_say_so_is_kept_from_its_resume_on(agent, tmp_path):
    tune(agent, tmp_path, stop_after=2)
    content = kept(tmp_path)
    del content["versions"]
    (tmp_path / "run.json").write_text(json.dumps(content))
    assert resumed(agent, tmp_path, 3) == []
    assert kept(tmp_path)["resumed_with"] == [{"update": 2, "versions": HERE}]


@pytest.mark.parametrize("wrong", [3, {}, [3], [{"versions": {}}], [{"update": -1, "versions": {}}]])
def test_a_damaged_record_of_versions_is_refused(agent, tmp_path, wrong):
    tune(agent, tmp_path, stop_after=1)
    content = kept(tmp_path)
    (tmp_path / "run.json").write_text(json.dumps(content | {"resumed_with": wrong}))
    with pytest.raises(UsageError, match="no valid updates and versions below resumed_with"):
        resumed(agent, tmp_path)


def test_the_command_says_it_on_standard_error_in_one_line(agent, tmp_path):
    agent.save(tmp_path / "agent.safetensors")
    run = tmp_path / "run"
    command = ("tune", tmp_path / "agent.safetensors", "--output", run, "--updates", 2, "--directions", 1)
    more = ("--evaluate-every", 0, "--workers", 0, "--resume", "--json")
    begun = drs(*command, *more, "--stop-after", 1)
    assert begun.returncode == 0 and "goes on with" not in begun.stderr
    then = {name: f"{version}.before\x1b[2J" for name, version in HERE.items()}
    (run / "run.json").write_text(json.dumps(kept(run) | {"versions": then}))
    result = drs(*command, *more)
    assert result.returncode == 0 and json.loads(result.stdout)["updates_done"] == 2
    (line,) = (line for line in result.stderr.splitlines() if "goes on with" in line)
    assert f"numpy {HERE['numpy']} (before: {HERE['numpy']}.before\\x1b[2J)" in line and "\x1b" not in line
    assert line.endswith("one set of versions.")
    assert kept(run)["resumed_with"] == [{"update": 1, "versions": HERE}]
