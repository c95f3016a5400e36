"""One backend a run: chosen once, proved before it is used, named in run.json, obeyed by workers."""

import ctypes
import dataclasses
import json
import logging
import os
import shutil
import signal

import numpy as np
import pytest

from drs_core.accelerator import backend, choose, compiled, library, make_runner, robot
from drs_core.accelerator import build as builder
from drs_core.accelerator.build import FLAGS, FOLDER, LIBRARY, NotBuilt, build, compiler, source_digest
from drs_core.accelerator.compiled import CompiledRunner
from drs_core.environments import Environment
from drs_core.errors import DrsError, UsageError
from drs_core.rollouts import InProcess, ProcessPool, Task, local
from drs_core.search import SearchConfig, ask
from drs_core.tune_config import TuneConfig
from drs_core.tuning import Tuning
from tests.conftest import drs, make_agent, refused
from tests.test_tuning import Silent

HOPPER = "HopperBulletEnv-v0"
CONFIG = TuneConfig(SearchConfig(updates=2, directions=2), evaluate_every=0, backend="compiled")


def told(caplog):
    [record] = [record for record in caplog.records if record.name == "drs"]
    assert record.levelno == logging.WARNING and "\n" not in record.getMessage()
    return record.getMessage()


@pytest.fixture
def no_cache():
    library.helper.cache_clear()
    yield
    library.helper.cache_clear()


def test_where_a_compiler_is_the_helper_is_built(tmp_path):
    if compiler() is None:
        pytest.skip("there is no C compiler")
    made = ctypes.CDLL(str(build(tmp_path)))
    made.drs_source_digest.restype = ctypes.c_char_p
    assert made.drs_source_digest().decode() == source_digest()
    assert (FOLDER / LIBRARY).exists(), "install the package again, or: python -m drs_core.accelerator"


def test_without_a_compiler_it_says_so(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "/nonexistent/cc")
    with pytest.raises(NotBuilt, match="no C compiler"):
        build(tmp_path)
    monkeypatch.setenv("CC", shutil.which("false") or "false")
    with pytest.raises(NotBuilt, match="failed"):
        build(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_it_is_built_for_plain_sse2_and_rounds_twice():
    assert "-march=x86-64" in FLAGS and "-ffp-contract=off" in FLAGS and not any("fast" in flag for flag in FLAGS)


@pytest.mark.usefixtures("built")
def test_compiled_is_chosen_where_it_runs(caplog):
    assert choose("compiled", make_agent(HOPPER)) == "compiled"
    assert choose("python", make_agent(HOPPER)) == "python"
    assert not caplog.records


def test_an_unknown_backend_is_wrong_use():
    for wrong in (lambda: choose("fast", make_agent()), lambda: make_runner(make_agent(), ""),
                  lambda: TuneConfig(backend="fast")):  # fmt: skip
        with pytest.raises(UsageError, match="python, plain, compiled"):
            wrong()


def test_another_environment_runs_in_python_with_one_line(caplog):
    assert choose("compiled", make_agent("MountainCarContinuous-v0")) == "python"
    assert "HopperBulletEnv-v0" in told(caplog) and "MountainCarContinuous-v0" in told(caplog)


def test_a_missing_helper(caplog, monkeypatch, tmp_path):
    monkeypatch.setattr(backend, "CompiledRunner", lambda *_: library.helper(tmp_path / "none.so"))
    assert choose("compiled", make_agent(HOPPER)) == "python"
    assert "not compiled" in told(caplog) and "python -m drs_core.accelerator" in told(caplog)


@pytest.mark.usefixtures("built", "no_cache")
def test_a_helper_of_other_sources(monkeypatch, caplog):
    monkeypatch.setattr(library, "source_digest", lambda: "0" * 64)
    assert choose("compiled", make_agent(HOPPER)) == "python"
    assert "other sources" in told(caplog)


def test_a_file_that_is_no_library(tmp_path):
    (tmp_path / LIBRARY).write_text("nonsense")
    with pytest.raises(library.Unavailable, match=r"cannot be loaded|is proved"):
        library.helper(tmp_path / LIBRARY)


@pytest.mark.usefixtures("built", "no_cache")
def test_a_version_that_was_not_proved(monkeypatch, caplog):
    monkeypatch.setitem(library.PROVED, "pybullet", "3.2.6")
    assert choose("compiled", make_agent(HOPPER)) == "python"
    assert "only 3.2.6 is proved" in told(caplog)


@pytest.fixture
def variant(tmp_path, monkeypatch):
    """Builds a helper from the sources with a text replaced."""
    if compiler() is None:
        pytest.skip("there is no C compiler")

    def make(old, new):
        for source in builder.SOURCES:
            (tmp_path / source.name).write_text(source.read_text().replace(old, new))
        monkeypatch.setattr(builder, "SOURCES", tuple(tmp_path / source.name for source in builder.SOURCES))
        monkeypatch.setattr(library, "source_digest", builder.source_digest)
        return builder.build(tmp_path)

    return make


@pytest.mark.usefixtures("built")
def test_a_wrong_magic_number(variant):
    """As if PyBullet were of another version: it refuses the helper when it loads it."""
    path = variant("202010061", "201010061")
    environment = Environment(HOPPER)
    environment.reset(0)
    with pytest.raises(library.Unavailable, match="magic number"):
        library.client_of(environment.unwrapped._p, path)
    environment.close()


@pytest.mark.usefixtures("built")
def test_an_episode_does_not_depend_on_the_width_of_the_processors_vectors(variant, monkeypatch):
    agent, environment = make_agent(HOPPER, hidden=(61, 35)), Environment(HOPPER)
    here = CompiledRunner(agent, environment)
    path = variant('target_clones("avx2", "default")', "noinline")
    monkeypatch.setattr(compiled, "helper", lambda: library.helper(path))
    plain = CompiledRunner(agent, environment)
    assert plain._library is not here._library
    for seed in range(5):
        expected = here.rollout(seed)
        actions = expected.actions.copy()
        assert plain.rollout(seed).actions.tobytes() == actions.tobytes()
    environment.close()


@pytest.mark.usefixtures("built")
@pytest.mark.parametrize(
    ("rules", "words"),
    [
        (robot.Rules(0.8, 1e-9), "reward of step 0"),
        (robot.Rules(0.8, 1.0, falls=False), "ending of step"),
    ],
)
def test_a_helper_that_differs_is_not_used(monkeypatch, caplog, rules, words):
    monkeypatch.setitem(robot.RULES, HOPPER, rules)
    agent = make_agent(HOPPER)
    assert choose("compiled", agent) == "python"
    assert words in told(caplog)
    with pytest.raises(DrsError, match="keeps one backend"):
        InProcess(agent, "compiled")


@pytest.mark.usefixtures("built")
def test_any_number_of_workers_some_of_them_killed():
    agent = make_agent(HOPPER)
    asked = ask(SearchConfig(directions=6, sigma=(0.1, 0.1)), 0)
    tasks = [Task(seed, frozenset({"dimension"}), perturbation) for perturbation, seed in asked]
    alone = InProcess(agent, "compiled")
    expected = alone.run(agent.theta, tasks)
    assert alone.run(agent.theta, tasks[::-1]) == expected[::-1]
    alone.close()
    with ProcessPool(agent, 2, "compiled") as pool:
        assert pool.run(agent.theta, tasks) == expected
        killed = []

        def kill(done):
            if done == 3 and not killed:
                killed.append(pool.pids[0])
                os.kill(pool.pids[0], signal.SIGKILL)

        assert pool.run(agent.theta, tasks, kill) == expected and killed


def test_a_worker_that_cannot_says_so():
    with pytest.raises(DrsError, match="cannot run here"):
        local(make_agent("MountainCarContinuous-v0"), 1, "compiled")


@pytest.mark.usefixtures("built")
def test_run_json_names_it_and_resume_refuses_the_other(tmp_path):
    agent, path = make_agent(HOPPER), tmp_path / "run"
    rollouts = local(agent, 0, "compiled")
    whole = Tuning(agent, "agent", CONFIG, tmp_path / "whole").run(rollouts, Silent())
    Tuning(agent, "agent", CONFIG, path).run(rollouts, Silent(), 1)
    assert json.loads((path / "run.json").read_text())["config"]["backend"] == "compiled"
    with pytest.raises(UsageError, match="backend = compiled, not python"):
        Tuning(agent, "agent", dataclasses.replace(CONFIG, backend="python"), path, resume=True)
    resumed = Tuning(agent, "agent", CONFIG, path, resume=True).run(rollouts, Silent())
    assert np.array_equal(resumed.theta, whole.theta)
    rollouts.close()


def test_a_folder_that_names_none_is_of_python(tmp_path):
    agent, path = make_agent(), tmp_path / "run"
    config = dataclasses.replace(CONFIG, backend="python")
    Tuning(agent, "agent", config, path)
    content = json.loads((path / "run.json").read_text())
    del content["config"]["backend"]
    (path / "run.json").write_text(json.dumps(content))
    Tuning(agent, "agent", config, path, resume=True)
    with pytest.raises(UsageError, match="backend = python, not compiled"):
        Tuning(agent, "agent", CONFIG, path, resume=True)


@pytest.mark.usefixtures("built")
def test_the_command_line(tmp_path):
    hopper, car = tmp_path / "hopper.safetensors", tmp_path / "car.safetensors"
    make_agent(HOPPER).save(hopper)
    make_agent().save(car)
    few = ("--episodes", 3, "--workers", 1, "--backend", "compiled", "--json")
    done = drs("evaluate", hopper, *few)
    assert done.returncode == 0 and json.loads(done.stdout)["backend"] == "compiled" and done.stderr == ""
    done = drs("evaluate", car, *few)
    assert json.loads(done.stdout)["backend"] == "python" and done.stderr.count("without the accelerator") == 1
    assert json.loads(drs("compare", hopper, hopper, *few).stdout)["backend"] == "compiled"
    run = ("tune", hopper, "--output", tmp_path / "run", "--directions", 1, "--updates", 2,
           "--evaluate-every", 0, "--workers", 0)  # fmt: skip
    assert drs(*run, "--backend", "compiled", "--stop-after", 1).returncode == 0
    refused(drs(*run, "--resume"), "backend = compiled")
    assert drs(*run, "--resume", "--backend", "compiled").returncode == 0
    refused(drs(*run, "--backend", "fast"), "allowed are python, plain, compiled")
