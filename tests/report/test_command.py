"""``drs report`` as a user runs it: what it writes, and what it refuses before any work."""

import json
import re
import shutil

import pytest

from drs_core.agent import load
from tests.conftest import drs, refused


def test_the_page_is_one_small_file_that_asks_for_nothing(panda_report):
    path, result = panda_report
    page = path.read_text()
    assert result["bytes"] == path.stat().st_size < 5_000_000 and 10_000 < result["video_bytes"] < 3_000_000
    assert (result["updates_done"], result["updates"], len(result["shown_seeds"])) == (2, 2, 1)
    assert set(result["verdicts"]) >= {"return_mean", "tip_speed_mean", "tip_jerk_mean_square"}
    assert "default-src 'none'" in page and "<script" not in page
    links = re.findall(r'(?:src|href|poster)="(?!data:|#)([^"]*)', page)
    assert links == [] and "@import" not in page and not re.search(r"url\((?!#)", page)
    # every colour in a figure is the page's, for light and dark
    assert not re.findall(r"(?:fill|stroke): *(?:#|white|black)", page)
    text = re.sub("<[^>]*>", "", page)
    assert "drs tune panda_reach --output runs/repeated --updates 2 --directions 2" in text
    assert load(path.parent / "agent.safetensors").digest() in page
    assert str(path.parent) not in page and not list(path.parent.glob(".*.tmp"))


def test_the_numbers_are_those_of_compare(panda_report):
    path, _ = panda_report
    text = re.sub("<[^>]*>", "", path.read_text())
    command = re.search(r"drs (compare panda_reach) (\S+) (--episodes 10 .*)", text)
    arguments = [*command[1].split(), path.parent / "agent.safetensors", *command[3].split()]
    result = json.loads(drs(*arguments, "--workers", 0, "--json").stdout)
    cell = f"{result['after']['tip_speed_mean']:.4f}"
    assert cell in path.read_text()


def test_the_same_run_gives_the_same_page_and_only_a_report_is_replaced(panda_run, tmp_path):
    run, other = tmp_path / "run", tmp_path / "other.html"
    shutil.copytree(panda_run, run)
    (run / "report.html").write_text("mine")
    quick = ("report", run, "--episodes", 10, "--workers", 0, "--no-video")
    refused(drs(*quick), "is no report", "--force")
    assert (run / "report.html").read_text() == "mine"
    assert drs(*quick, "--output", other).returncode == 0
    first = other.read_bytes()
    assert drs(*quick, "--output", other).returncode == 0
    assert other.read_bytes() == first and b"no-video" in first and b"<video" not in first


def test_what_is_refused_before_any_work(panda_run, agent, tmp_path):
    run, agent_file = tmp_path / "run", tmp_path / "other.safetensors"
    shutil.copytree(panda_run, run)
    agent.save(agent_file)
    refused(drs("report", tmp_path), "no run", "run.json")
    refused(drs("report", run, "--before", agent_file), "not the agent that the run began with", "--before")
    refused(drs("report", run, "--after", agent_file), "was not made by the run")
    refused(drs("report", run, "--after", "none.safetensors"), "none.safetensors")
    refused(drs("report", run, "--episodes", 9), "9", "10 to")
    refused(drs("report", run, "--output", tmp_path / "none" / "x.html"), "none")
    refused(drs("report", run, "--output", tmp_path), "is a folder")
    content = json.loads((run / "run.json").read_text())
    gone = {**content, "agent": {**content["agent"], "name": "/home/somebody/gone.safetensors"}}
    (run / "run.json").write_text(json.dumps(gone))
    refused(drs("report", run), "gone.safetensors", "--before")
    (run / "report.html").unlink(missing_ok=True)
    result = drs("report", run, "--before", "panda_reach", "--episodes", 10, "--no-video", "--workers", 0)
    assert result.returncode == 0, result.stderr
    # of a path only its last part is told
    assert "/home/somebody" not in (run / "report.html").read_text()


@pytest.mark.parametrize(
    ("key", "value", "word"),
    [
        ("format", 9, "version"),
        ("agent", [], "agent"),
        ("agent", {"name": 3}, "name"),
        ("versions", 3, "versions"),
        ("config", {"updates": "<b>"}, "updates"),
        ("config", {"objective": "x"}, "objective"),
        ("config", {"new": 1}, "new"),
    ],
)
def test_a_damaged_run_is_refused_with_its_place(panda_run, tmp_path, key, value, word):
    run = tmp_path / "run"
    run.mkdir()
    content = json.loads((panda_run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps({**content, key: value}))
    refused(drs("report", run), word)


@pytest.mark.parametrize("line", ['{"update": 1}', '{"update": 1, "alpha": "<b>"}', "[]", "{"])
def test_a_damaged_history_is_refused(panda_run, tmp_path, line):
    run = tmp_path / "run"
    run.mkdir()
    shutil.copy(panda_run / "run.json", run)
    (run / "history.jsonl").write_text(line + "\n")
    refused(drs("report", run), "history.jsonl")


def test_where_a_run_went_back_is_marked(panda_run, panda_report, tmp_path):
    run = tmp_path / "run"
    shutil.copytree(panda_run, run)
    first, second = (run / "history.jsonl").read_text().splitlines()
    (run / "history.jsonl").write_text("\n".join((first, json.dumps({**json.loads(second), "backed_off": 1}))) + "\n")
    result = drs("report", run, "--episodes", 10, "--workers", 0, "--no-video")
    assert result.returncode == 0, result.stderr
    words = "back to the best agent"
    assert words in (run / "report.html").read_text() and words not in panda_report[0].read_text()


def test_a_run_that_went_on_with_other_versions_says_so(panda_run, panda_report, tmp_path):
    run = tmp_path / "run"
    shutil.copytree(panda_run, run)
    content = json.loads((run / "run.json").read_text())
    now = content["versions"]
    content |= {
        "versions": {**now, "numpy": "1.26.<b>"},
        "resumed_with": [{"update": 1, "versions": {**now, "numpy": "1.27"}}, {"update": 2, "versions": now}],
    }
    (run / "run.json").write_text(json.dumps(content))
    result = drs("report", run, "--episodes", 10, "--workers", 0, "--no-video")
    assert result.returncode == 0, result.stderr
    page = (run / "report.html").read_text()
    assert "After update 1 the run went on with numpy 1.27 (before: 1.26.&lt;b&gt;)." in page
    assert f"After update 2 the run went on with numpy {now['numpy']} (before: 1.27)." in page
    assert "No one set of versions repeats it to the bit." in page
    assert f"made with others: numpy {now['numpy']} (run: 1.26.&lt;b&gt; and 1.27)." in page
    assert "went on with" not in panda_report[0].read_text() and "made with others" not in panda_report[0].read_text()
