"""Runs in which episodes are broken off, sigma is capped, and somebody stands beside."""

import json
from dataclasses import replace

import numpy as np
import pytest

from drs_core import json_lines
from drs_core.agent import load
from drs_core.episode import unfinished
from drs_core.errors import DrsError, UsageError
from drs_core.evaluation import evaluate, summary
from drs_core.objective import Objective
from drs_core.observed import of_episodes
from drs_core.plan import Plan
from drs_core.rollouts import InProcess, Task
from drs_core.search import ask, tell
from drs_core.tune_config import TuneConfig
from drs_core.tuning import Tuning
from tests.test_tuning import CONFIG, SMOOTH, Interrupting, Silent, records, same, tune


class Breaking(InProcess):
    """Breaks off an episode where `breaks(call, task)` says so; calls are counted from 0."""

    def __init__(self, agent, breaks):
        super().__init__(agent)
        self.breaks, self.call = breaks, -1

    def run(self, theta, tasks, progress=None):
        self.call += 1
        episodes = super().run(theta, tasks, progress)
        return [
            unfinished(task.seed, "reflex") if self.breaks(self.call, task) else episode
            for task, episode in zip(tasks, episodes, strict=True)
        ]


def run(agent, path, breaks, config=CONFIG, resume=False, stop_after=None, **more):
    return Tuning(agent, "agent", config, path, resume).run(Breaking(agent, breaks), Silent(), stop_after, **more)


def plus(task, *directions):
    return task.perturbation is not None and task.perturbation.sign == 1 and task.perturbation.direction in directions


def without_counts(path):
    keys = ("pairs_repeated", "pairs_dropped")
    return [{key: value for key, value in record.items() if key not in keys} for record in records(path)]


@pytest.mark.parametrize("config", [CONFIG, SMOOTH], ids=["return", "smooth"])
def test_where_repeats_finish_the_run_is_the_undisturbed_one(agent, tmp_path, config):
    tune(agent, tmp_path / "straight", config=config)
    # every other batch is a repeat, and finishes: of pairs, of evaluations and of the baseline
    breaks = lambda call, task: call % 2 == 0 and (task.perturbation is None or plus(task, 1))  # noqa: E731
    # more than half of the first attempt may be broken off, as long as they finish later
    run(agent, tmp_path / "run", breaks, config)
    for name in ("agent.safetensors", "best.safetensors", "evaluations.jsonl", "run.json"):
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "straight" / name).read_bytes(), name
    assert without_counts(tmp_path / "run") == records(tmp_path / "straight")
    assert all((r["pairs_repeated"], r["pairs_dropped"]) == (1, 0) for r in records(tmp_path / "run"))
    assert not any("pairs" in key for r in records(tmp_path / "straight") for key in r)


def test_a_pair_that_never_finishes_leaves_the_step_of_the_rest(agent, tmp_path):
    config = replace(CONFIG, evaluate_every=0)
    tuned = run(agent, tmp_path, lambda call, task: plus(task, 2), config, stop_after=1)
    asked = ask(config.search, 0)
    whole = InProcess(agent)
    returns = [whole.run(p.candidate(agent.theta), [Task(seed)])[0].return_ for p, seed in asked]
    objectives = np.array(returns).reshape(-1, 2)
    objectives[2] = np.nan
    assert tuned.theta.tobytes() == tell(config.search, 0, agent.theta, objectives).tobytes()
    (record,) = json_lines.read(tmp_path / "history.jsonl")
    assert (record["pairs_repeated"], record["pairs_dropped"]) == (1, 1)
    assert record["objective_mean"] == objectives[:2].mean()


def test_fewer_than_half_of_the_pairs_end_the_run_and_change_nothing(agent, tmp_path):
    straight = tmp_path / "straight"
    tune(agent, straight)
    path = tmp_path / "run"
    run(agent, path, lambda call, task: False, stop_after=2)
    before = {file.name: file.read_bytes() for file in path.iterdir() if file.is_file()}
    told = []

    class Listening:
        def before(self, plan):
            told.append(plan.sentence())

        def on_unfinished(self, episodes, again):
            told.append((len(episodes), again))

    with pytest.raises(DrsError, match=r"Only 1 of 3 pairs of rollouts could be finished in 3 attempts \(reflex\)"):
        run(agent, path, lambda call, task: plus(task, 0, 2), resume=True, attendant=Listening())
    assert {file.name: file.read_bytes() for file in path.iterdir() if file.is_file()} == before
    assert told[1:] == [(2, True), (2, True), (2, False)]
    assert told[0].startswith("Next: update 3 of 6: 6 episodes with the policy changed by sigma 0.22, each of at most")
    run(agent, path, lambda call, task: False, resume=True)
    same(path, straight)


def test_an_evaluation_with_gaps_says_so_and_is_no_candidate_for_the_best(agent, tmp_path):
    seeds = []

    def breaks(call, task):
        if task.perturbation is None and not seeds:
            seeds.append(task.seed)
        return task.perturbation is None and task.seed in seeds

    run(agent, tmp_path, breaks)
    evaluations = json_lines.read(tmp_path / "evaluations.jsonl")
    assert [(e["episodes"], e["unfinished"]) for e in evaluations] == [(2, 1)] * 4
    assert not (tmp_path / "best.safetensors").exists()
    with pytest.raises(DrsError, match="Only 0 of 3 episodes of an evaluation"):
        run(agent, tmp_path / "none", lambda call, task: task.perturbation is None)


def test_an_evaluation_counts_whole_episodes_alone(agent):
    found = evaluate("agent", agent, Breaking(agent, lambda call, task: task.seed == 2), 5, 0)
    assert found.unfinished == 1 and [episode.seed for episode in found.episodes] == [0, 1, 3, 4]
    assert summary(found)["episodes"] == 4 and np.isfinite(summary(found)["return_mean"])
    again = evaluate("agent", agent, Breaking(agent, lambda call, task: task.seed == 2 and call < 2), 5, 0)
    whole = evaluate("agent", agent, InProcess(agent), 5, 0)
    assert again.unfinished == 0 and again.returns.tolist() == whole.returns.tolist()


CAPPED = replace(CONFIG, action_change_max=0.2)


def test_a_capped_run_keeps_the_cap_and_resumes_bit_for_bit(agent, tmp_path):
    straight, path = tmp_path / "straight", tmp_path / "run"
    plans = []

    class Listening:
        def before(self, plan):
            plans.append(plan)

        def on_unfinished(self, episodes, again):
            raise AssertionError

    Tuning(agent, "agent", CAPPED, straight).run(InProcess(agent), Silent(), attendant=Listening())
    with pytest.raises(KeyboardInterrupt):
        tune(agent, path, observer=Interrupting(3), config=CAPPED)
    tune(agent, path, resume=True, config=CAPPED)
    same(path, straight)
    assert (path / "observations.safetensors").read_bytes() == (straight / "observations.safetensors").read_bytes()
    sigmas = [record["sigma"] for record in records(path)]
    uncapped = [CONFIG.search.sigma_at(update) for update in range(6)]
    assert all(sigma <= most for sigma, most in zip(sigmas, uncapped, strict=True)) and min(sigmas) < 0.1
    updates = [plan for plan in plans if plan.update]
    assert [plan.sigma for plan in updates] == sigmas and all(0.0 < plan.change <= 0.2 for plan in updates)
    assert "no action changes by more than 0." in updates[0].sentence()
    assert plans[-1].sentence().startswith("Next: an evaluation: 3 episodes with the policy as it is, each of at most")


def test_a_cap_that_nothing_reaches_changes_nothing(agent, tmp_path):
    tune(agent, tmp_path / "plain")
    tune(agent, tmp_path / "capped", config=replace(CONFIG, action_change_max=1e3))
    assert records(tmp_path / "capped") == records(tmp_path / "plain")
    ends = [load(tmp_path / name / "agent.safetensors").theta.tobytes() for name in ("plain", "capped")]
    assert ends[0] == ends[1]


def test_observations_are_read_once(agent, tmp_path):
    rows, asked = of_episodes(agent, 9)[:20], []

    def observe():
        asked.append(True)
        return rows

    def go(**more):
        return Tuning(agent, "agent", CAPPED, tmp_path / "run", observe=observe, **more)

    # kept when the run begins: whoever resumes one that was killed at once need not give them again
    go()._lock.close()
    (tmp_path / "run" / "run.json").unlink()
    with pytest.raises(UsageError, match=r"cannot be continued without run.json"):
        Tuning(agent, "agent", CAPPED, tmp_path / "run", resume=True)
    go(resume=True)._lock.close()
    assert json.loads((tmp_path / "run" / "run.json").read_text())["observations"]["source"] == "recording"
    Tuning(agent, "agent", CAPPED, tmp_path / "run", resume=True).run(InProcess(agent), Silent(), 1)
    go(resume=True).run(InProcess(agent), Silent(), 2)
    assert asked == [True, True]
    assert json.loads((tmp_path / "run" / "run.json").read_text())["observations"]["count"] == 20
    with pytest.raises(UsageError, match="action_change_max is 0"):
        Tuning(agent, "agent", CONFIG, tmp_path / "other", observe=observe)
    assert not (tmp_path / "other").exists()


def test_a_folder_of_an_earlier_version_is_continued(agent, tmp_path):
    straight, path = tmp_path / "straight", tmp_path / "run"
    tune(agent, straight)
    tune(agent, path, stop_after=2)
    content = json.loads((path / "run.json").read_text())
    for name in ("attempts", "action_change_max", "top", "back_off"):
        del content["config"][name]
    (path / "run.json").write_text(json.dumps(content))
    with pytest.raises(UsageError, match="attempts = 3, not 4"):
        Tuning(agent, "agent", replace(CONFIG, attempts=4), path, resume=True)
    tune(agent, path, resume=True)
    assert (path / "agent.safetensors").read_bytes() == (straight / "agent.safetensors").read_bytes()
    assert records(path) == records(straight)


@pytest.mark.parametrize("values", [{"attempts": 0}, {"attempts": 101}, {"action_change_max": -1.0},
                                    {"action_change_max": float("nan")}])  # fmt: skip
def test_settings_out_of_range_are_named(values):
    with pytest.raises(UsageError, match=next(iter(values))):
        TuneConfig(objective=Objective(), **values)


def test_what_comes_next_is_said_in_seconds_where_there_are_seconds():
    arm = Plan("PandaReach-v3", 3, 20, pairs=16, evaluations=20, sigma=0.02368, change=0.1204)
    assert arm.sentence() == (
        "Next: update 3 of 20: 32 episodes with the policy changed by sigma 0.02368 and 20 with the policy as it is, "
        "each of at most 2 s (50 steps at 25 Hz), 104 s in all without resets. On the recorded observations no "
        "action changes by more than 0.12."
    )
    other = Plan("Pendulum-v1", None, 20, evaluations=32)
    assert other.sentence() == "Next: an evaluation: 32 episodes with the policy as it is."
    start = Plan("Pendulum-v1", None, 20, baseline=32)
    assert start.sentence() == "Next: an evaluation: 32 episodes with the policy that the run began with."
    assert start.episodes == 32
