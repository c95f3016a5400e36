"""The command line as a user meets it: processes, exit statuses, standard output, files."""

import json
import os
import pty
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

import drs_core
from drs_core import json_lines
from drs_core.agent import load
from tests.conftest import drs, make_agent, refused
from tests.test_evaluation import CONTRACT, PANDA

QUICK = ("--directions", 2, "--updates", 2, "--evaluate-every", 0, "--workers", 1)


def only_json(result):
    """The one JSON object that standard output holds."""
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("\n") == 1
    return json.loads(result.stdout)


def test_evaluate_prints_one_json_object_with_the_keys_of_the_contract():
    result = only_json(drs("evaluate", "panda_reach", "--episodes", 3, "--workers", 1, "--json"))
    assert set(CONTRACT + PANDA) <= set(result)
    assert (result["agent"], result["environment"], result["episodes"]) == ("panda_reach", "PandaReach-v3", 3)


def test_the_version():
    said = drs("--version")
    assert (said.returncode, said.stdout) == (0, f"drs {drs_core.__version__}\n")


def test_plain_stepping_changes_the_speed_and_nothing_else(tmp_path):
    rates = ("rollouts_per_second", "steps_per_second")
    found = []
    for more in ((), ("--backend", "plain")):
        result = json.loads(drs("evaluate", "panda_reach", "--episodes", 3, "--workers", 1, "--json", *more).stdout)
        found.append({key: value for key, value in result.items() if key not in (*rates, "backend")})
    assert found[0] == found[1]


_OTHER_VERSION = """
import sys
from drs_core.environments.fast import proved
proved.PROVED["panda-gym"] = "1.2.3"
from drs_core.cli import main
sys.argv[1:] = ["evaluate", "panda_reach", "--episodes", "4", "--json", *sys.argv[1:]]
main()
"""


@pytest.mark.parametrize(
    ("more", "times"), [(["--workers", "2"], 1), (["--workers", "0"], 1), (["--backend", "plain"], 0)]
)
def test_another_version_of_the_simulator_is_said_once_and_not_on_stdout(more, times):
    result = subprocess.run([sys.executable, "-c", _OTHER_VERSION, *more], capture_output=True, text=True, timeout=120)
    assert json.loads(result.stdout)["success_percent"] == 100
    assert result.stderr.count("Fast stepping is off") == result.stderr.count("(proved: 1.2.3)") == times


def test_evaluate_prints_a_table_for_people(agent_file):
    result = drs("evaluate", agent_file, "--episodes", 3, "--workers", 0)
    assert result.returncode == 0, result.stderr
    for words in ("return", "success [%]", "length [steps]", "rollouts/s", "MountainCarContinuous-v0"):
        assert words in result.stdout


def test_evaluate_takes_whatever_import_takes(shared):
    folder = shared / "agents" / "a2c" / "MountainCarContinuous-v0_1"
    result = only_json(drs("evaluate", folder, "--episodes", 2, "--workers", 0, "--json"))
    assert result["return_mean"] > 85


def test_import_makes_a_file_that_is_the_same_agent(shared, tmp_path):
    folder, output = shared / "agents" / "tqc" / "PandaReach-v1_1", tmp_path / "reach.safetensors"
    result = only_json(drs("import", folder, "-o", output, "--json"))
    assert result["environment"] == "PandaReach-v3" and result["source"]["algorithm"] == "tqc"
    assert len(result["source"]["sha256"]) == 64
    assert load(output).pipeline.time_limit_steps == 50
    refused(drs("import", folder, "-o", output), "exists already", "--force")
    assert drs("import", folder, "-o", output, "--force").returncode == 0


def test_tune_compare_and_resume(agent_file, tmp_path):
    run = tmp_path / "run"
    result = only_json(drs("tune", agent_file, "--output", run, *QUICK, "--stop-after", 1, "--json"))
    assert result["updates_done"] == 1
    refused(drs("tune", agent_file, "--output", run, *QUICK), "--resume")
    refused(drs("tune", agent_file, "--output", run, *QUICK, "--resume", "--seed", 3), "seed = 0, not 3")
    done = drs("tune", agent_file, "--output", run, *QUICK, "--resume")
    assert done.returncode == 0 and "update 2/2" in done.stderr
    tuned = run / "agent.safetensors"
    comparison = only_json(drs("compare", agent_file, tuned, "--episodes", 4, "--workers", 1, "--json"))
    assert comparison["before"]["seed"] == comparison["after"]["seed"] == 0
    assert 0 <= comparison["probability_after_better"] <= 1
    text = drs("compare", agent_file, tuned, "--episodes", 4, "--workers", 1)
    assert "P(after better)" in text.stdout and "after minus before" in text.stdout


def test_compare_draws_the_motion_of_the_tip(tmp_path):
    for name in ("tip.png", "tip.svg"):
        figure = tmp_path / name
        result = drs("compare", "panda_reach", "panda_reach", "--episodes", 1, "--workers", 0, "--figure", figure)
        assert result.returncode == 0, result.stderr
        assert figure.stat().st_size > 10_000
    assert (tmp_path / "tip.png").read_bytes()[:4] == b"\x89PNG"
    svg = (tmp_path / "tip.svg").read_text()
    assert "<svg" in svg and not list(tmp_path.glob(".*"))


def test_the_parameter_file_is_read_and_options_win(agent_file, tmp_path):
    params = tmp_path / "p.yaml"
    params.write_text("/**:\n  ros__parameters: {updates: 7, directions: 2, seed: 3, autostart: true, agent: x}\n")
    run = tmp_path / "run"
    only_json(drs("tune", agent_file, "--output", run, "--params", params, "--seed", 4, "--stop-after", 1, "--json"))
    config = json.loads((run / "run.json").read_text())["config"]
    assert (config["updates"], config["directions"], config["seed"]) == (7, 2, 4)


@pytest.mark.parametrize(
    ("line", "word"),
    [("updatse: 3", "updatse"), ("updates: x", "updates"), ("updates: 0", "updates"), ("sigma: [.nan, 1]", "sigma"),
     ("alpha: [-1, 0]", "alpha"), ("objective: speed", "speed"), ("directions: 1000000", "directions"),
     ("evaluation_episodes: 0", "evaluation_episodes"), ("seed: -1", "seed")],
)  # fmt: skip
def test_wrong_parameters_are_named_and_nothing_is_begun(agent_file, tmp_path, line, word):
    params, run = tmp_path / "p.yaml", tmp_path / "run"
    params.write_text(f"/**:\n  ros__parameters:\n    {line}\n")
    result = drs("tune", agent_file, "--output", run, "--params", params)
    refused(result, word)
    assert result.returncode == 2 and not run.exists()


def test_wrong_use_has_status_2(agent_file, tmp_path):
    for arguments in (
        ("evaluate",),
        ("fly",),
        ("evaluate", agent_file, "--episodes", "many"),
        ("evaluate", agent_file, "--episodes", 0),
        ("evaluate", agent_file, "--workers", -1),
        ("evaluate", "no_such_agent"),
        ("evaluate", tmp_path),
        ("compare", agent_file, "panda_reach"),
        ("tune", agent_file, "--output", tmp_path / "r", "--rollouts", "magic"),
        ("tune", agent_file, "--output", tmp_path / "r", "--stop-after", 0),
        ("train", "dqn", "PandaReach-v3", "-o", tmp_path / "x.safetensors"),
        ("train", "tqc", "NoSuch-v0", "-o", tmp_path / "x.safetensors"),
        ("train", "tqc", "PandaReach-v3", "-o", tmp_path / "x.zip"),
        ("train", "tqc", "PandaReach-v3", "-o", tmp_path / "x.safetensors", "--hidden=-3"),
        ("tune", agent_file, "--output", tmp_path / "r", "--workers", 999),
        ("compare", agent_file, agent_file, "--figure", tmp_path / "x.png"),
        ("compare", "panda_reach", "panda_reach", "--figure", tmp_path / "x.exe"),
        ("compare", "panda_reach", "panda_reach", "--figure", tmp_path / "none" / "x.png"),
    ):
        result = drs(*arguments)
        assert result.returncode == 2, (arguments, result)
        assert result.stdout == "" and "Traceback" not in result.stderr and result.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["agent.safetensors"]


def test_smooth_needs_no_weight_and_takes_one(agent_file, tmp_path):
    quick = ("--objective", "smooth", *QUICK, "--json")
    found = only_json(drs("tune", agent_file, "--output", tmp_path / "found", *quick))["smoothness_weight"]
    assert found == json.loads((tmp_path / "found" / "run.json").read_text())["baseline"]["smoothness_weight"] > 0
    given = only_json(drs("tune", agent_file, "--output", tmp_path / "given", *quick, "--smoothness-weight", 7))
    assert given["smoothness_weight"] == 7.0
    other = drs("tune", agent_file, "--output", tmp_path / "found", *quick, "--smoothness-weight", 7, "--resume")
    refused(other, "smoothness_weight = None, not 7.0")


def test_an_output_folder_that_cannot_be_made(agent_file, tmp_path):
    (tmp_path / "file").write_text("mine")
    refused(drs("tune", agent_file, "--output", tmp_path / "file" / "run", *QUICK), "file")
    refused(drs("tune", agent_file, "--output", tmp_path / "file", *QUICK), "file")
    assert (tmp_path / "file").read_text() == "mine"


def test_streams_that_are_closed_or_full_and_names_that_look_like_markup(agent_file, tmp_path):
    shell = f"{sys.executable} -m drs_core.cli"
    for command in ("agents >/dev/full", "agents --json >/dev/full"):
        result = subprocess.run(f"{shell} {command}", shell=True, capture_output=True, text=True)
        assert result.returncode == 1 and "Traceback" not in result.stderr and "space" in result.stderr
    for command in ("agents >&-", "agents --json >&-", "agents 2>&-"):
        result = subprocess.run(f"{shell} {command}", shell=True, capture_output=True, text=True)
        assert result.returncode == 0 and "Traceback" not in result.stderr
    for name in ("[b].safetensors", "[b]:smile:.safetensors"):
        odd = tmp_path / name
        odd.write_bytes(agent_file.read_bytes())
        result = drs("evaluate", odd, "--episodes", 2, "--workers", 0)
        assert result.returncode == 0 and name in "".join(result.stdout.split()), result.stderr
    result = drs("tune", agent_file, "--output", tmp_path / "run[/final]:smile:", *QUICK, "--stop-after", 1)
    assert result.returncode == 0 and "run[/final]:smile:" in result.stdout


def test_a_name_that_is_too_long(agent_file, tmp_path):
    long = "x" * 300
    refused(drs("evaluate", tmp_path / long), "too long")
    refused(drs("import", agent_file, "-o", tmp_path / f"{long}.safetensors"))
    refused(drs("tune", agent_file, "--output", tmp_path / long, *QUICK))


def test_an_agent_with_wrong_numbers(tmp_path):
    agent = make_agent()
    content = bytearray(agent.to_bytes())
    content[-4:] = np.float32("nan").tobytes()
    path = tmp_path / "nan.safetensors"
    path.write_bytes(content)
    refused(drs("evaluate", path), "finite")


@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_within_two_seconds_with_everything_kept(agent_file, tmp_path, sign):
    run = tmp_path / "run"
    process = subprocess.Popen(
        [sys.executable, "-m", "drs_core.cli", "tune", str(agent_file), "--output", str(run), "--workers", "2"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    while not (run / "agent.safetensors").exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    start = time.monotonic()
    os.killpg(process.pid, sign) if sign == signal.SIGINT else process.send_signal(sign)
    _, stderr = process.communicate(timeout=10)
    assert time.monotonic() - start < 2.5
    assert process.returncode == 130 and "Traceback" not in stderr and "--resume" in stderr
    done = load(run / "agent.safetensors").tuning[-1]["updates_done"]
    assert [record["update"] for record in json_lines.read(run / "history.jsonl")] == [*range(1, done + 1)]
    while subprocess.run(["pgrep", "-g", str(process.pid)], capture_output=True).stdout:
        assert time.monotonic() - start < 5  # no process of the group is left


def test_workers_end_when_their_parent_is_killed(agent_file, tmp_path):
    run = tmp_path / "run"
    process = subprocess.Popen(
        [sys.executable, "-m", "drs_core.cli", "tune", str(agent_file), "--output", str(run), "--workers", "2"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    while not (run / "agent.safetensors").exists():
        time.sleep(0.05)
    process.kill()
    process.wait()
    end = time.monotonic() + 10
    while subprocess.run(["pgrep", "-g", str(process.pid)], capture_output=True).stdout:
        assert time.monotonic() < end
        time.sleep(0.05)
    done = drs("tune", agent_file, "--output", run, "--resume", "--stop-after", 1, "--json")
    assert only_json(done)["updates_done"] >= 1


def test_progress_is_a_bar_on_a_terminal(agent_file, tmp_path):
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "drs_core.cli", "tune", agent_file, "--output", tmp_path / "r", *QUICK]
    process = subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE, stderr=slave, close_fds=True)
    os.close(slave)
    seen = b""
    while True:
        try:
            chunk = os.read(master, 65536)
        except OSError:
            break
        if not chunk:
            break
        seen += chunk
    assert process.wait() == 0
    assert b"rollouts of this update" in seen and b"update 2/2" in seen
    process.stdout.close()


def test_train_makes_an_agent_that_is_the_same_every_time(tmp_path):
    pytest.importorskip("torch")
    for name in ("one", "two"):
        output = tmp_path / f"{name}.safetensors"
        result = drs(
            "train",
            "tqc",
            "PandaReach-v3",
            "-o",
            output,
            "--steps",
            1100,
            "--evaluate-every",
            1100,
            "--hidden",
            "16,16",
        )
        assert result.returncode == 0, result.stderr
    one, two = (load(tmp_path / f"{name}.safetensors") for name in ("one", "two"))
    # byte for byte, but for the time that it took
    assert one.source["wall_s"] > 0
    assert replace(one, source={**one.source, "wall_s": 0}).to_bytes() == (
        replace(two, source={**two.source, "wall_s": 0}).to_bytes()
    )
    agent = two
    assert agent.network.sizes == (13, 16, 16, 3) and agent.source["steps"] == 1100
    assert agent.pipeline.time_limit_steps == 50 and agent.pipeline.parts[0].mean is not None


@pytest.mark.parametrize(
    ("algorithm", "environment"), [("ppo", "MountainCarContinuous-v0"), ("sac", "HopperBulletEnv-v0")]
)
def test_train_other_algorithms(tmp_path, algorithm, environment):
    pytest.importorskip("torch")
    output = tmp_path / "x.safetensors"
    result = drs("train", algorithm, environment, "-o", output, "--steps", 1200, "--hidden", 16, "--no-time-feature")
    assert result.returncode == 0, result.stderr
    assert load(output).environment == environment


def test_agents_lists_the_shipped_ones():
    names = [row["name"] for row in only_json(drs("agents", "--json"))["agents"]]
    assert "panda_reach" in names
    assert "panda_reach" in drs("agents").stdout


def test_help_is_quick_and_names_every_command():
    result = drs("--help")
    for command in ("import", "evaluate", "tune", "compare", "train", "agents"):
        assert command in result.stdout
    assert result.returncode == 0 and drs("tune", "--help").returncode == 0
