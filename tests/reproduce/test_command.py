"""`drs reproduce` as a user meets it."""

import csv
import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from drs_core import json_lines
from drs_core.errors import UsageError
from drs_core.reproduce.config import ReproduceConfig
from tests.conftest import drs, refused

TINY = ("--rows", "MountainCar-a2c,MountainCar-td3", "--updates", 11, "--episodes", 5, "--workers", 0)


def command(shared, output, *more):
    return ("reproduce", "I", "--agents", shared / "agents", "--output", output, *TINY, *more)


@pytest.fixture(scope="module")
def straight(shared, tmp_path_factory):
    """A run that nothing has interrupted, and what it printed."""
    output = tmp_path_factory.mktemp("straight")
    answer = drs(*command(shared, output, "--json"))
    assert answer.returncode == 0, answer.stderr
    return output, answer


def run_folder(output):
    return output / "MountainCar-a2c" / "return-0"


def test_json_alone_on_standard_output_and_the_missing_row_named(straight):
    _, answer = straight
    assert answer.stdout.count("\n") == 1
    result = json.loads(answer.stdout)
    assert [row["row"] for row in result["rows"]] == ["MountainCar-a2c"]
    assert list(result["skipped"]) == ["MountainCar-td3"]
    assert "MountainCar-td3 is skipped" in answer.stderr and "no td3 agent" in answer.stderr
    (row,) = result["rows"]
    assert (row["updates"], row["rollouts"], row["stop_reason"]) == (11, 11 * 128, "updates")
    assert (row["backend"], row["agent"]) == ("python", "a2c/MountainCarContinuous-v0_1")
    assert row["tuned_agent"] == "best" and row["tuned_update"] in (0, 10)
    q = row["quantities"]["return"]
    assert (q["paper_before"], q["paper_after"]) == (91.0, 92.0)
    assert q["before"] + q["gain"] == pytest.approx(q["after"])
    for key in ("before", "after", "gain"):
        assert q[f"{key}_ci95"][0] <= q[key] <= q[f"{key}_ci95"][1]
    assert q["mark"] in ("better", "equal", "worse") and q["baseline_mark"] in ("better", "equal", "worse")
    assert q["difference_to_paper"] == pytest.approx(q["after"] - 92.0)


def test_the_evaluation_is_that_of_drs_evaluate(straight):
    output, answer = straight
    best = run_folder(output) / "best.safetensors"
    summary = json.loads(drs("evaluate", best, "--episodes", 5, "--workers", 0, "--json").stdout)
    q = json.loads(answer.stdout)["rows"][0]["quantities"]["return"]
    assert (q["after"], q["after_ci95"]) == (summary["return_mean"], summary["return_ci95"])


def test_asked_again_nothing_is_run(straight, shared, tmp_path):
    output, answer = straight
    files = [path for path in output.rglob("*") if path.is_file()]
    stamps = [path.stat().st_mtime_ns for path in files]
    table, page = tmp_path / "out.csv", tmp_path / "out.md"
    again = drs(*command(shared, output, "--csv", table, "--markdown", page))
    assert again.returncode == 0, again.stderr
    assert [path.stat().st_mtime_ns for path in files] == stamps
    assert sorted(files) == sorted(path for path in output.rglob("*") if path.is_file())
    for words in ("Table I", "1 MountainCar-a2c", "91 -> 92", "--updates", "Skipped, without an agent"):
        assert words in again.stdout and words in page.read_text()
    (line,) = csv.DictReader(table.open())
    q = json.loads(answer.stdout)["rows"][0]["quantities"]["return"]
    assert float(line["after"]) == q["after"] and float(line["gain_ci95_low"]) == q["gain_ci95"][0]
    assert line["row"] == "MountainCar-a2c" and line["mark"] == q["mark"] and "numpy 2" in line["versions"]
    assert line["command"].startswith("drs reproduce I --rows MountainCar-a2c,MountainCar-td3 --agents ZOO")
    refused(drs(*command(shared, output, "--csv", table)), "out.csv exists already", "--force")
    assert drs(*command(shared, output, "--csv", table, "--force")).returncode == 0


def test_a_row_names_what_made_it_and_not_what_prints_it(straight, shared, tmp_path):
    output, answer = straight
    (row,), now = (json.loads(answer.stdout)[key] for key in ("rows", "versions"))
    evaluated = [{"episode": 0, "versions": now}]
    assert row["made_with"] == {
        "tuning": [{"update": 0, "versions": now}],
        "before": evaluated,
        "after": evaluated,
    }
    shutil.copytree(output, tmp_path / "runs")
    run_json, before = run_folder(tmp_path / "runs") / "run.json", tmp_path / "runs" / "MountainCar-a2c" / "before.json"
    content = json.loads(run_json.read_text())
    there = {**now, "numpy": "1.26.0", "pybullet": "3.2.5"}
    run_json.write_text(json.dumps(content | {"versions": there}))
    # as an earlier version has left it
    kept = json.loads(before.read_text())
    del kept["made_with"]
    before.write_text(json.dumps(kept))
    table, page = tmp_path / "out.csv", tmp_path / "out.md"
    again = drs(*command(shared, tmp_path / "runs", "--updates", 10, "--csv", table, "--markdown", page))
    assert again.returncode == 0, again.stderr
    made = "MountainCar-a2c was made in part with numpy 1.26.0, pybullet 3.2.5 and versions that are unknown."
    further = "More updates than --updates 10, by an earlier command: MountainCar-a2c (11)."
    for words in (made, further):
        assert words in " ".join(again.stdout.split()) and words in page.read_text()
        assert words not in answer.stdout
    assert ", except for what is said above." in page.read_text()
    (line,) = csv.DictReader(table.open())
    assert f"numpy 1.26.0 and {now['numpy']};" in line["versions"] and line["versions"].endswith("; in part unknown")
    assert line["updates"] == "11"


def signalled(shared, output, number):
    """A run that gets a signal after its second update; what it said."""
    arguments = [sys.executable, "-m", "drs_core.cli", *map(str, command(shared, output))]
    process = subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True)
    history = run_folder(output) / "history.jsonl"
    deadline = time.monotonic() + 100
    while len(json_lines.read(history)) < 2:
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.01)
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert len(json_lines.read(history)) < 11
    return process.returncode, said


def test_killed_at_any_moment_it_goes_on_to_the_same_bytes(straight, shared, tmp_path):
    signalled(shared, tmp_path, signal.SIGKILL)
    again = drs(*command(shared, tmp_path, "--json"))
    assert again.returncode == 0, again.stderr
    output, answer = straight
    for name in ("agent.safetensors", "best.safetensors", "evaluations.jsonl"):
        assert (run_folder(tmp_path) / name).read_bytes() == (run_folder(output) / name).read_bytes(), name
    (theirs,), (ours,) = (json.loads(text.stdout)["rows"] for text in (answer, again))
    assert ours["quantities"] == theirs["quantities"]


def test_sigterm_is_ctrl_c(shared, tmp_path):
    status, said = signalled(shared, tmp_path, signal.SIGTERM)
    assert status == 130 and "the same command goes on" in said and "Traceback" not in said
    assert (run_folder(tmp_path) / "agent.safetensors").exists()


def test_wrong_use_is_refused_before_any_work(shared, tmp_path):
    agents = ("--agents", shared / "agents", "--output", tmp_path / "runs")
    refused(drs("reproduce", "I", *agents, "--rows", "Cartpole"), "Cartpole", "Hopper-a2c/ppo")
    refused(drs("reproduce", "I", *agents, "--rows", "Ant-*"), "None of the 6 rows has an agent", "--agents")
    refused(drs("reproduce", "I", *agents, "--csv", tmp_path / "none" / "x.csv"), "does not exist")
    assert not (tmp_path / "runs").exists()


def test_a_file_in_the_way_of_the_folder_is_the_users_mistake(tmp_path):
    (tmp_path / "taken").touch()
    result = drs("reproduce", "IV", "--rows", "PandaSlide-tqc", "--output", tmp_path / "taken")
    refused(result, "a file is there; choose another one")
    assert result.returncode == 2


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"table": "V"}, "choose I, II, III, IV"),
        ({"updates": 0}, "1 to 200"),
        ({"updates": 201}, "1 to 200"),
        ({"patience": -1}, "0 to 200"),
        ({"hours": 0.0}, "above 0"),
        ({"hours": float("nan")}, "finite"),
        ({"episodes": 1}, "2 or more"),
        ({"seed": -1}, "seed is -1"),
        ({"backend": "warp"}, "compiled"),
        ({"agents": Path("nowhere")}, "no folder nowhere"),
    ],
)
def test_a_wrong_setting_is_named_with_what_is_allowed(wrong, words):
    with pytest.raises(UsageError, match=words):
        ReproduceConfig(**{"table": "I"} | wrong)
