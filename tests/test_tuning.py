"""Runs: resume equals never having stopped, and what is on disk is always whole."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drs_core import json_lines
from drs_core.agent import load
from drs_core.errors import UsageError
from drs_core.objective import KAPPA, Objective
from drs_core.parameters import read_parameters
from drs_core.rollouts import InProcess, local
from drs_core.search import SearchConfig
from drs_core.tune_config import TuneConfig, tune_config
from drs_core.tuning import Tuning
from tests.conftest import make_agent

ROOT = Path(__file__).parents[1]

CONFIG = TuneConfig(
    SearchConfig(updates=6, directions=3, alpha=(0.3, 0.1), sigma=(0.3, 0.1), seed=5),
    evaluate_every=2,
    evaluation_episodes=3,
)


class Silent:
    def on_rollouts(self, update, done, total):
        pass

    def on_update(self, record):
        pass

    def on_evaluation(self, record):
        pass


class Interrupting(Silent):
    """Ctrl-C in the middle of update `at`."""

    def __init__(self, at):
        self.at = at

    def on_rollouts(self, update, done, total):
        if update == self.at and done == total // 2:
            raise KeyboardInterrupt


def tune(agent, path, stop_after=None, workers=0, resume=False, observer=None, config=CONFIG):
    rollouts = local(agent, workers)
    try:
        return Tuning(agent, "agent", config, path, resume).run(rollouts, observer or Silent(), stop_after)
    finally:
        rollouts.close()


def records(path):
    """History without what a clock decides."""
    return [
        {key: value for key, value in record.items() if key not in ("wall_s", "rollouts_per_second")}
        for record in json_lines.read(path / "history.jsonl")
    ]


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    path = tmp_path_factory.mktemp("straight")
    tune(make_agent(), path)
    return path


def same(path, straight):
    for name in ("agent.safetensors", "best.safetensors", "evaluations.jsonl"):
        assert (path / name).read_bytes() == (straight / name).read_bytes(), name
    assert records(path) == records(straight)
    assert json.loads((path / "run.json").read_text()) == json.loads((straight / "run.json").read_text())


def test_six_updates_are_three_and_three_more_with_another_number_of_workers(agent, tmp_path, straight):
    tune(agent, tmp_path, stop_after=3, workers=2)
    assert load(tmp_path / "agent.safetensors").tuning[-1]["updates_done"] == 3
    tune(agent, tmp_path, workers=1, resume=True)
    same(tmp_path, straight)
    assert [record["update"] for record in records(tmp_path)] == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize("at", [1, 2, 3, 6])
def test_interrupted_in_the_middle_of_an_update(agent, tmp_path, straight, at):
    with pytest.raises(KeyboardInterrupt):
        tune(agent, tmp_path, observer=Interrupting(at))
    assert len(records(tmp_path)) == at - 1
    tune(agent, tmp_path, resume=True)
    same(tmp_path, straight)


WRITES = {"history": 6, "evaluations": 4, "best": 2, "agent": 6}
"""How often an uninterrupted run writes each file."""


@pytest.mark.parametrize(("where", "at"), [(where, at + 1) for where, count in WRITES.items() for at in range(count)])
def test_a_crash_between_two_writes(agent, tmp_path, straight, where, at, monkeypatch):
    """Every write in turn is the last one that reaches the disk."""
    from drs_core.agent import Agent

    class Crash(Exception):
        pass

    count = 0

    def crashing(original, matches):
        def write(*arguments):
            nonlocal count
            original(*arguments)
            if matches(arguments):
                count += 1
                if count == at:
                    raise Crash

        return write

    named = {"history": "history.jsonl", "evaluations": "evaluations.jsonl"}
    if where in named:
        replaced = crashing(json_lines.append, lambda a: a[0].name == named[where])
        monkeypatch.setattr(json_lines, "append", replaced)
    else:
        replaced = crashing(Agent.save, lambda a: a[1].name == f"{where}.safetensors")
        monkeypatch.setattr(Agent, "save", replaced)
    with pytest.raises(Crash):
        tune(agent, tmp_path)
    monkeypatch.undo()
    tune(agent, tmp_path, resume=True)
    same(tmp_path, straight)


def test_a_history_line_cut_at_any_byte(agent, tmp_path, straight):
    tune(agent, tmp_path, stop_after=2)
    history = tmp_path / "history.jsonl"
    whole = history.read_bytes()
    agent_bytes = (tmp_path / "agent.safetensors").read_bytes()
    line = b'{"update": 3, "alpha": 0.2}\n'
    for size in range(len(line) + 1):
        history.write_bytes(whole + line[:size])
        Tuning(agent, "agent", CONFIG, tmp_path, resume=True)
        assert history.read_bytes() == whole
    assert (tmp_path / "agent.safetensors").read_bytes() == agent_bytes
    tune(agent, tmp_path, resume=True)
    same(tmp_path, straight)


def test_an_evaluation_shares_a_batch_with_the_rollouts_around_it(agent, tmp_path):
    sizes = []

    class Counting(InProcess):
        def run(self, theta, tasks, progress=None):
            sizes.append(len(tasks))
            return super().run(theta, tasks, progress)

    Tuning(agent, "agent", CONFIG, tmp_path).run(Counting(agent), Silent())
    assert sizes == [9, 6, 9, 6, 9, 6, 3]


def test_the_best_agent_is_the_best_of_the_evaluations(straight):
    evaluations = json_lines.read(straight / "evaluations.jsonl")
    assert [record["update"] for record in evaluations] == [0, 2, 4, 6]
    best = load(straight / "best.safetensors").tuning[-1]
    top = max(evaluations, key=lambda record: record["objective_mean"])
    assert (best["updates_done"], best["objective_mean"]) == (top["update"], top["objective_mean"])


def test_history_has_the_keys_of_the_contract(straight):
    keys = {"update", "alpha", "sigma", "objective_mean", "objective_std", "return_mean", "return_std", "step_norm"}
    for record in json_lines.read(straight / "history.jsonl"):
        assert keys | {"rollouts_per_second", "wall_s"} <= set(record)
        assert record["step_norm"] > 0


def test_curves_do_not_import_torch_and_leave_it_importable():
    pytest.importorskip("torch")
    code = "import sys; from drs_core.curves import tensorboard_modules as m; m(); assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", f"{code}; import torch"], check=True)


def test_tensorboard_has_every_update_once(agent, tmp_path):
    event_accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    with pytest.raises(KeyboardInterrupt):
        tune(agent, tmp_path, observer=Interrupting(4))
    tune(agent, tmp_path, resume=True)
    events = event_accumulator.EventAccumulator(str(tmp_path / "tensorboard")).Reload()
    scalars = events.Scalars("update/objective_mean")
    assert [scalar.step for scalar in scalars] == [1, 2, 3, 4, 5, 6]
    assert [scalar.step for scalar in events.Scalars("evaluation/return_mean")] == [0, 2, 4, 6]


def test_a_finished_run_resumes_to_itself(agent, tmp_path, straight):
    tune(agent, tmp_path)
    tune(agent, tmp_path, resume=True)
    same(tmp_path, straight)


def test_the_schedule_is_the_papers_and_a_shorter_one_for_smooth():
    assert tune_config({}).search == SearchConfig()
    smooth = tune_config({"objective": "smooth", "updates": 20, "sigma": (0.1, 0.1)}).search
    assert (smooth.alpha, smooth.sigma, smooth.updates) == ((0.02, 0.01), (0.1, 0.1), 20)
    gains = tune_config({"objective": "smooth", "action_gains": True, "alpha": (0.3, 0.2)}).search
    assert (gains.alpha, gains.sigma) == ((0.3, 0.2), (0.15, 0.075))
    preset = tune_config(read_parameters(ROOT / "params" / "smooth_gains.yaml")).search
    assert preset == tune_config({"action_gains": True, "updates": 20, "directions": 16}).search


SMOOTH = replace(CONFIG, objective=Objective("smooth"))


def test_smooth_without_a_weight_is_smooth_with_the_weight_of_its_baseline(agent, tmp_path):
    tuned = tune(agent, tmp_path / "automatic", config=SMOOTH)
    baseline = json.loads((tmp_path / "automatic" / "run.json").read_text())["baseline"]
    weight = baseline["smoothness_weight"]
    assert weight == pytest.approx(KAPPA * baseline["return_std"] / baseline["action_change_mean"]) and weight > 0
    assert tuned.tuning[-1]["smoothness_weight"] == weight
    given = tune(agent, tmp_path / "given", config=replace(CONFIG, objective=Objective("smooth", weight)))
    assert given.theta.tobytes() == tuned.theta.tobytes()
    plain = tune(agent, tmp_path / "plain")
    assert plain.theta.tobytes() != tuned.theta.tobytes()


class StopsInBatch(InProcess):
    """Ctrl-C in the middle of a batch: 0 is the baseline, 1 the first update."""

    def __init__(self, agent, at):
        super().__init__(agent)
        self.left = at

    def run(self, theta, tasks, progress=None):
        self.left -= 1
        if self.left < 0:
            super().run(theta, tasks[: len(tasks) // 2], progress)
            raise KeyboardInterrupt
        return super().run(theta, tasks, progress)


@pytest.mark.parametrize("at", [0, 1, 2, 4])
def test_a_run_with_automatic_weight_resumes_bit_for_bit(agent, tmp_path, at):
    tune(agent, tmp_path / "straight", config=SMOOTH)
    with pytest.raises(KeyboardInterrupt):
        Tuning(agent, "agent", SMOOTH, tmp_path / "run").run(StopsInBatch(agent, at), Silent())
    assert ("baseline" in json.loads((tmp_path / "run" / "run.json").read_text())) == (at > 0)
    tune(agent, tmp_path / "run", resume=True, workers=2, config=SMOOTH)
    same(tmp_path / "run", tmp_path / "straight")


@pytest.mark.parametrize("baseline", [3, {}, *({"smoothness_weight": weight} for weight in ("5", -1.0, 1e308))])
def test_a_damaged_baseline_is_refused(agent, tmp_path, baseline):
    tune(agent, tmp_path, stop_after=1, config=SMOOTH)
    content = json.loads((tmp_path / "run.json").read_text())
    (tmp_path / "run.json").write_text(json.dumps(content | {"baseline": baseline}))
    with pytest.raises(UsageError, match="baseline"):
        Tuning(agent, "agent", SMOOTH, tmp_path, resume=True)


def test_without_evaluation_there_is_no_best(agent, tmp_path):
    config = TuneConfig(CONFIG.search, evaluate_every=0)
    tune(agent, tmp_path, config=config)
    assert not (tmp_path / "best.safetensors").exists() and not (tmp_path / "evaluations.jsonl").exists()
    assert (tmp_path / "agent.safetensors").exists()


def test_the_last_layer_alone_is_tuned(tmp_path, agent):
    config = TuneConfig(replace(CONFIG.search, last_layer=True, updates=1), evaluate_every=0)
    tuned = tune(agent, tmp_path, config=config)
    start = agent.network.last_layer_start
    assert (tuned.theta[:start] == agent.theta[:start]).all() and (tuned.theta[start:] != agent.theta[start:]).any()


def test_a_run_of_a_version_that_did_not_know_gains_goes_on(tmp_path, agent):
    whole = tune(agent, tmp_path / "whole")
    tune(agent, tmp_path / "older", stop_after=1)
    path = tmp_path / "older" / "run.json"
    stored = json.loads(path.read_text())
    del stored["config"]["action_gains"], stored["config"]["paired_spread"]
    path.write_text(json.dumps(stored))
    assert np.array_equal(tune(agent, tmp_path / "older", resume=True).theta, whole.theta)


def test_the_gains_of_the_actions_alone_are_tuned(tmp_path, agent):
    config = TuneConfig(replace(CONFIG.search, action_gains=True), evaluate_every=0)
    tuned = tune(agent, tmp_path / "whole", config=config)
    for (weight, bias), (before, offset) in zip(agent.network.layers(tuned.theta), agent.network.layers(agent.theta)):
        if len(bias) > len(agent.low):
            assert np.array_equal(weight, before) and np.array_equal(bias, offset)
        else:
            gains = (weight / before).mean(axis=1)
            np.testing.assert_allclose(weight, gains[:, None] * before, rtol=1e-5)
            np.testing.assert_allclose(bias, gains * offset, rtol=1e-5)
            assert (gains != 1).all() and (gains > 0).all()
    tune(agent, tmp_path / "parts", config=config, stop_after=1)
    resumed = tune(agent, tmp_path / "parts", config=config, resume=True)
    assert np.array_equal(resumed.theta, tuned.theta)


def test_a_tuned_agent_can_be_tuned_again_and_remembers_both(agent, tmp_path):
    first = tune(agent, tmp_path / "one", stop_after=1)
    second = tune(first, tmp_path / "two", stop_after=2)
    assert [record["updates_done"] for record in second.tuning] == [1, 2]


def test_a_reward_that_is_not_finite_ends_the_run_with_a_sentence(agent, tmp_path, monkeypatch):
    from drs_core.environments import Environment
    from drs_core.errors import DrsError

    step = Environment.step
    monkeypatch.setattr(Environment, "step", lambda self, action: step(self, action)._replace(reward=np.nan))
    with pytest.raises(DrsError, match="not finite"):
        Tuning(agent, "agent", CONFIG, tmp_path).run(InProcess(agent), Silent())
