"""The folder of a run: whose it is, who works in it, and what is refused and left as it is."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Barrier

import pytest

from drs_core.agent import load
from drs_core.errors import UsageError
from drs_core.objective import Objective
from drs_core.rollouts import InProcess
from drs_core.search import SearchConfig
from drs_core.tune_config import TuneConfig
from drs_core.tuning import Tuning
from tests.conftest import make_agent
from tests.test_tuning import CONFIG, Silent, same, tune


def test_two_processes_cannot_tune_in_one_folder(agent, tmp_path):
    first = Tuning(agent, "agent", CONFIG, tmp_path)
    with pytest.raises(UsageError, match="Another process"):
        Tuning(agent, "agent", CONFIG, tmp_path, resume=True)
    rollouts = InProcess(agent)
    first.run(rollouts, Silent(), 1)
    Tuning(agent, "agent", CONFIG, tmp_path, resume=True).run(rollouts, Silent(), 2)
    rollouts.close()


def test_of_two_that_begin_at_once_one_begins(agent, tmp_path):
    barrier = Barrier(2)

    def begin(path, seed):
        config = replace(CONFIG, search=replace(CONFIG.search, seed=seed))
        barrier.wait()
        try:
            return seed, Tuning(agent, "agent", config, path)
        except UsageError as error:
            assert "holds a run" in str(error) or "Another process" in str(error)
            return None

    with ThreadPoolExecutor(2) as pool:
        for attempt in range(20):
            path = tmp_path / str(attempt)
            found = [begun for begun in pool.map(begin, [path, path], [0, 1]) if begun]
            assert [seed for seed, _ in found] == [json.loads((path / "run.json").read_text())["config"]["seed"]]


def test_records_that_no_such_run_writes_are_refused_unread(agent, tmp_path):
    tune(agent, tmp_path, stop_after=1)
    with open(tmp_path / "evaluations.jsonl", "ab") as file:
        file.truncate(2**40)
    with pytest.raises(UsageError, match=r"evaluations.jsonl is larger than what 6 updates write"):
        Tuning(agent, "agent", CONFIG, tmp_path, resume=True)


def test_files_of_another_run_or_of_others_are_left_alone(agent, tmp_path):
    tune(agent, tmp_path / "run", stop_after=1)
    with open(tmp_path / "run" / "history.jsonl", "a") as file:
        file.write('{"update": "x"}\n')
    with pytest.raises(UsageError, match="not a record"):
        Tuning(agent, "agent", CONFIG, tmp_path / "run", resume=True)
    other = make_agent(hidden=(5,))
    other.with_theta(other.theta, ({"updates_done": 2},)).save(tmp_path / "run" / "agent.safetensors")
    with pytest.raises(UsageError, match="not of this run"):
        Tuning(agent, "agent", CONFIG, tmp_path / "run", resume=True)
    foreign = tmp_path / "foreign" / "evaluations.jsonl"
    foreign.parent.mkdir()
    foreign.write_text("mine")
    with pytest.raises(UsageError, match="holds a run"):
        Tuning(agent, "agent", CONFIG, foreign.parent)
    assert foreign.read_text() == "mine"


def test_the_best_agent_has_to_be_the_one_of_the_evaluations(agent, tmp_path):
    tune(agent, tmp_path / "run", stop_after=5)
    tune(agent, tmp_path / "other", stop_after=5, config=replace(CONFIG, search=replace(CONFIG.search, seed=6)))
    best, newest = tmp_path / "run" / "best.safetensors", tmp_path / "run" / "agent.safetensors"
    right, done = best.read_bytes(), newest.read_bytes()
    history = (tmp_path / "run" / "history.jsonl").read_bytes()

    def refused(said):
        with pytest.raises(UsageError, match=said):
            Tuning(agent, "agent", CONFIG, tmp_path / "run", resume=True)
        assert (tmp_path / "run" / "history.jsonl").read_bytes() == history

    best.unlink()
    refused("best.safetensors is gone, the best agent of 3 evaluations; put the right file back")
    best.write_bytes((tmp_path / "other" / "best.safetensors").read_bytes())
    refused("is not the agent that was evaluated after update")
    make_agent(hidden=(3,)).save(best)
    refused("has no evaluation in its record")
    best.write_bytes(right)
    # an agent of before the best one
    newest.unlink()
    refused(f"is of update {load(best).tuning[-1]['updates_done']}, but agent.safetensors of update 0")
    newest.write_bytes(done)
    tune(agent, tmp_path / "run", resume=True)
    tune(agent, tmp_path / "straight")
    same(tmp_path / "run", tmp_path / "straight")


def test_a_run_of_another_configuration_or_agent_is_refused_and_untouched(agent, tmp_path):
    tune(agent, tmp_path, stop_after=1)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    other = TuneConfig(SearchConfig(updates=6, directions=3, alpha=(0.3, 0.1), sigma=(0.3, 0.1), seed=6), Objective())
    with pytest.raises(UsageError, match="seed = 5, not 6"):
        Tuning(agent, "agent", other, tmp_path, resume=True)
    with pytest.raises(UsageError, match="another agent"):
        Tuning(make_agent(seed=1), "agent", CONFIG, tmp_path, resume=True)
    with pytest.raises(UsageError, match="--resume"):
        Tuning(agent, "agent", CONFIG, tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


def test_all_that_differs_is_told_at_once_with_the_way_to_go_on(agent, tmp_path):
    tune(agent, tmp_path, stop_after=1)
    search = replace(CONFIG.search, directions=4, top=2, sigma=(0.2, 0.1))
    with pytest.raises(UsageError) as refused:
        Tuning(agent, "agent", TuneConfig(search, Objective("dimension")), tmp_path, resume=True)
    assert str(refused.value) == (
        f"{tmp_path} was begun with objective = return, not dimension; directions = 3, not 4; "
        "sigma = [0.3, 0.1], not [0.2, 0.1]; top = 0, not 2; evaluate_every = 2, not 10; "
        "evaluation_episodes = 3, not 20. The command that began it goes on (drs tune: with --resume): "
        "give the same options, for example by the same --params file, or a new folder."
    )


def test_what_a_foreign_run_json_says_does_not_fill_the_message(agent, tmp_path):
    tune(agent, tmp_path, stop_after=1)
    content = json.loads((tmp_path / "run.json").read_text())
    content["config"] |= {"objective": "x" * 5000, "sigma": list(range(5000))}
    (tmp_path / "run.json").write_text(json.dumps(content))
    with pytest.raises(UsageError) as refused:
        Tuning(agent, "agent", CONFIG, tmp_path, resume=True)
    assert len(str(refused.value)) < 600 and str(refused.value).endswith("or a new folder.")


@pytest.mark.parametrize("content", ["", "{", "[]", '{"format": 1}', '{"format": 1, "config": 3}', "NaN"])
def test_a_damaged_run_json_is_refused(agent, tmp_path, content):
    (tmp_path / "run.json").write_text(content)
    with pytest.raises(UsageError):
        Tuning(agent, "agent", CONFIG, tmp_path, resume=True)
