"""A training that was killed goes on; a damaged state is left for the one before; others are refused."""

import importlib
import json
import os
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from drs_core.agent import load
from drs_core.errors import UsageError
from tests.conftest import drs, refused

torch = pytest.importorskip("torch")

from drs_core.training.checkpoint import Checkpoints  # noqa: E402
from drs_core.training.config import TrainConfig  # noqa: E402
from drs_core.training.folder import TrainingFolder  # noqa: E402
from drs_core.training.judging import promising  # noqa: E402
from drs_core.training.model import LinearDecay, make_learner  # noqa: E402
from drs_core.training.train import train  # noqa: E402

SMALL = {"learning_starts": 60, "batch_size": 16, "buffer_size": 500}
REACH = TrainConfig("tqc", "PandaReach-v3", steps=600, hidden=(8,), evaluate_every=200, episodes=2, settings=SMALL)
CAR = TrainConfig(
    "sac", "MountainCarContinuous-v0", steps=300, hidden=(4,), evaluate_every=150, episodes=1, settings=SMALL
)
COMMAND = (
    *("train", "tqc", "PandaReach-v3", "--steps", "600", "--hidden", "8", "--evaluate-every", "200"),
    *("--evaluation-episodes", "2", "--checkpoint-minutes", "0.005"),
    *(word for name, value in SMALL.items() for word in ("--set", f"{name}={value}")),
)


def nothing(_text):
    pass


def evaluated(folder):
    return [json.loads(line) for line in (folder / "evaluations.jsonl").read_text().splitlines()]


def until(process, words):
    for line in process.stderr:
        if words in line:
            return line
    raise AssertionError(f"{words!r} never came")


def begin(*more):
    return subprocess.Popen(
        [sys.executable, "-m", "drs_core.cli", *COMMAND, *map(str, more)],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )


def test_terminated_and_killed_training_goes_on(tmp_path, monkeypatch):
    output, folder = tmp_path / "reach.safetensors", tmp_path / "reach.training"
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    with begin("-o", output) as process:
        until(process, "200 steps")
        process.send_signal(signal.SIGTERM)
        assert "continue with --resume" in until(process, "Stopped at")
        assert process.wait() == 130
    assert load(output).source["steps"] == 200
    with begin("-o", output, "--resume") as process:
        assert int(until(process, "Resumed at").split()[2]) >= 200
        until(process, "400 steps")
        process.kill()
    result = drs(*COMMAND, "-o", output, "--resume", "--json")
    assert result.returncode == 0, result.stderr
    # at 0.3 seconds between two states, the 200 steps before the evaluation were not all lost
    assert 200 < int(result.stderr.split("Resumed at ")[1].split()[0]) <= 401
    records = evaluated(folder)
    assert [record["steps"] for record in records] == [200, 400, 600]
    assert np.all(np.diff([record["wall_s"] for record in records]) > 0)
    assert (
        json.loads(result.stdout)["steps"]
        == load(output).source["steps"]
        == load(folder / "best.safetensors").source["steps"]
    )
    assert load(folder / "agent.safetensors").source["steps"] == 600
    refused(drs(*COMMAND, "-o", output, "--force"), "holds a training already", "--resume")
    refused(drs(*COMMAND, "-o", output, "--resume", "--seed", 1), "begun with seed = 0, not 1")
    assert not list(temporary.glob("SB3-*"))


@pytest.mark.parametrize("config", [REACH, CAR], ids=["hindsight", "plain"])
def test_restored_learner_takes_the_same_gradient_steps(tmp_path, config):
    def theta(learner):
        parameters = learner.model.get_parameters()["policy"]
        return np.concatenate([value.numpy().ravel() for value in parameters.values()])

    begun, folder = make_learner(config), TrainingFolder(tmp_path / "x")
    folder.begin(config.record())
    checkpoints = Checkpoints(folder, begun)
    for steps in (130, 77):
        begun.model.learn(steps, reset_num_timesteps=steps == 130)
        checkpoints.save({})
    begun.model.train(3, 16)
    following = torch.rand(3), np.random.rand(3), begun.episode_seeds.integers(2**31)
    expected = theta(begun)
    begun.close()
    again, opened = make_learner(config), TrainingFolder(tmp_path / "x")
    Checkpoints(opened, again).restore(opened.open(opened.generations()[0]))
    assert again.model.num_timesteps == 207
    again.model.set_logger(begun.model.logger)
    again.model.train(3, 16)
    np.testing.assert_array_equal(theta(again), expected)
    assert torch.equal(torch.rand(3), following[0]) and np.array_equal(np.random.rand(3), following[1])
    assert again.episode_seeds.integers(2**31) == following[2]
    again.model.learn(60, reset_num_timesteps=False)
    assert again.model.num_timesteps == 267
    again.close()


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("car") / "x.training"
    trained = train(CAR, folder, nothing, checkpoint_minutes=0.001)
    assert trained.finished
    return folder


def copied(folder, to):
    subprocess.run(["cp", "-r", folder, to], check=True)
    return to


@pytest.mark.parametrize("suffix", [".json", "-model.pt", "-state.npz"])
def test_damaged_newest_state_is_left_for_the_one_before(tmp_path, finished, suffix):
    folder, said = copied(finished, tmp_path / "x"), []
    newest, before = TrainingFolder(folder).generations()[:2]
    damaged = folder / "state" / f"{newest:05d}{suffix}"
    content = bytearray(damaged.read_bytes())
    content[len(content) // 2] ^= 1
    damaged.write_bytes(content)
    trained = train(CAR, folder, said.append, resume=True)
    assert trained.finished and trained.agent.source["steps"] in (150, 300)
    assert "damaged" in said[0] and "Resumed at" in said[1]
    assert TrainingFolder(folder).generations() == [newest + 1, before]
    assert [record["steps"] for record in evaluated(folder)] == [150, 300]


def test_without_a_whole_state_nothing_is_invented(tmp_path, finished):
    folder = copied(finished, tmp_path / "x")
    for file in (folder / "state").glob("*.json"):
        file.write_text("{}")
    with pytest.raises(UsageError, match=r"No state in .* is whole"):
        train(CAR, folder, nothing, resume=True)


@pytest.mark.parametrize("whole_writes", range(4))
def test_crash_at_any_write_of_a_state_leaves_the_one_before(tmp_path, finished, monkeypatch, whole_writes):
    folder, said = copied(finished, tmp_path / "x"), []
    module, left = importlib.import_module("drs_core.training.folder"), [whole_writes]
    write = module.write_atomically

    def crash(path, content):
        if left[0] == 0:
            raise MemoryError
        left[0] -= 1
        write(path, content)

    longer, before = replace(CAR, steps=320), TrainingFolder(folder).generations()
    with monkeypatch.context() as patched, pytest.raises(MemoryError):
        patched.setattr(module, "write_atomically", crash)
        train(longer, folder, nothing, resume=True)
    assert TrainingFolder(folder).generations() == before
    train(longer, folder, said.append, resume=True)
    assert "Resumed at 300 steps" in said[0]
    assert [record["steps"] for record in evaluated(folder)] == [150, 300, 320]


def test_more_steps_continue_a_finished_training(tmp_path, finished):
    folder = copied(finished, tmp_path / "x")

    train(replace(CAR, steps=400), folder, nothing, resume=True)
    assert [record["steps"] for record in evaluated(folder)] == [150, 300, 400]


def test_other_settings_and_other_folders_are_refused(tmp_path, finished):

    with pytest.raises(UsageError, match=r"begun with hidden = \[4\], not \[5\]"):
        train(replace(CAR, hidden=(5,)), finished, nothing, resume=True)
    with pytest.raises(UsageError, match="begun with settings"):
        train(replace(CAR, settings={**SMALL, "gamma": 0.5}), finished, nothing, resume=True)
    with pytest.raises(UsageError, match="holds a training already"):
        train(CAR, finished, nothing)
    (tmp_path / "run.json").write_text("{}")
    for resume in (False, True):
        with pytest.raises(UsageError, match="holds something else"):
            train(CAR, tmp_path, nothing, resume=resume)
    with pytest.raises(UsageError, match="does not take the settings"):
        train(replace(CAR, settings={"no_such": 1}), tmp_path / "new", nothing)
    assert not (tmp_path / "new").exists()
    with pytest.raises(UsageError, match="checkpoint_minutes is 0"):
        train(CAR, tmp_path / "new", nothing, checkpoint_minutes=0)


def test_best_is_by_success_then_return_on_all_episodes(tmp_path, monkeypatch):
    module = importlib.import_module("drs_core.training.train")

    shown = iter(
        [(2, 50, -30), (2, 100, -9), (100, 80, -8), (100, 90, -7), (100, 90, -7), (100, 90, -6), (100, 80, -1)]
    )

    def scripted(*_):
        episodes, success, mean = next(shown)
        rest = {"seed": 0, "return_std": 0.0, "length_mean": 50.0}
        return {"episodes": episodes, "success_percent": success, "return_mean": mean, **rest}

    monkeypatch.setattr(module, "judge", scripted)
    config = TrainConfig("ddpg", "MountainCarContinuous-v0", steps=70, hidden=(2,), evaluate_every=10, episodes=100)
    assert train(config, tmp_path / "x", nothing).agent.source["steps"] == 60
    assert [record["best"] for record in evaluated(tmp_path / "x")] == [True, True, True, True, False, True, False]


@pytest.mark.parametrize(
    ("first", "best", "expected"),
    [
        ((10, 0.0, -50.0), None, False),
        ((10, 20.0, -40.0), None, True),
        ((10, 70.0, -20.0), (100, 88.0, -10.0), True),
        ((10, 60.0, -20.0), (100, 88.0, -10.0), False),
        ((10, None, 900.0), (20, None, 1000.0), True),
        ((10, None, 700.0), (20, None, 1000.0), False),
        ((10, None, 1.0), (10, None, 1000.0), True),
    ],
)
def test_first_look_decides_who_is_judged_by_all_episodes(first, best, expected):
    keys = ("episodes", "success_percent", "return_mean")
    looked = {**dict(zip(keys, first, strict=True)), "return_std": 200.0 if first[1] is None else 10.0}
    assert promising(looked, best and dict(zip(keys, best, strict=True))) == expected


def test_learning_rate_falls_over_the_whole_training():
    decay = LinearDecay(0.1, 200)
    rates = []
    for decay.done in (0, 100, 200, 300):
        rates.append(decay(1.0))
    assert rates == [0.1, 0.05, 0.0, 0.0]


@pytest.mark.parametrize(
    ("algorithm", "environment"),
    [("tqc", "PandaSlide-v3"), *((name, "HopperBulletEnv-v0") for name in ("ddpg", "td3", "sac", "tqc"))],
)
def test_recipes_make_models_that_learn(tmp_path, algorithm, environment):
    config = TrainConfig(
        algorithm,
        environment,
        steps=160,
        hidden=(4,),
        evaluate_every=1000,
        episodes=1,
        settings={"learning_starts": 60, "buffer_size": 500, "batch_size": 8},
    )
    trained = train(config, tmp_path / "x", nothing)
    source = trained.agent.source
    assert source["algorithm"] == algorithm and source["settings"]["settings"]["batch_size"] == 8
    assert 160 <= source["steps"] < 160 + 64 and source["wall_s"] > 0
