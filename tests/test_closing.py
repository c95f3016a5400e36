"""What a run ends by saying, and what a folder is taken for."""

import re
import shlex

import pytest

from tests.conftest import drs, make_agent, refused
from tests.test_cli import QUICK, only_json


def test_a_run_ends_by_pointing_at_its_best(agent_file, tmp_path):
    ended = drs("tune", agent_file, "--output", tmp_path / "run", *QUICK, "--evaluate-every", 2)
    said = " ".join(ended.stdout.split())
    best = tmp_path / "run" / "best.safetensors"
    assert f"best of its evaluations with: drs report {best.parent} --after best" in said and str(best) in said
    # its folder stands for its newest agent
    newest = [
        only_json(drs("evaluate", *a, "--episodes", 2, "--json"))
        for a in ([best.parent], [best.parent / "agent.safetensors"])
    ]
    assert newest[0]["return_mean"] == newest[1]["return_mean"]
    plain = drs("tune", agent_file, "--output", tmp_path / "plain", *QUICK)
    assert f"newest agent with: drs report {tmp_path / 'plain'}, or" in " ".join(plain.stdout.split())


def test_the_closing_line_can_be_pasted_and_does_not_name_the_start_as_the_best(agent_file, tmp_path):
    run = tmp_path / "my runs" / "ü"
    # alpha of nothing: no evaluation can be better
    ended = drs("tune", agent_file, "--output", run, *QUICK, "--evaluate-every", 2, "--alpha", 1e-30, 1e-30)
    said = " ".join(ended.stdout.split())
    assert "No evaluation has found a better one than the start." in said and (run / "best.safetensors").exists()
    pasted = shlex.split(said.partition("Look at the newest agent with: ")[2])
    assert pasted == ["drs", "report", f"{run},", "or", "drs", "compare", str(agent_file), f"{run}/agent.safetensors"]


@pytest.mark.parametrize(
    "arguments",
    [
        ("tune", "panda_reach", "--output"),
        ("reproduce", "I", "--output"),
        ("bench", "--sample-cost", "--output"),
        ("graph", "x.yaml", "--output"),
        ("train", "tqc", "PandaReach-v3", "-o", "x.safetensors", "--run"),
    ],
)
def test_an_empty_folder_name_is_not_this_folder(arguments):
    refused(drs(*arguments, ""), "name is empty")


def test_a_run_folder_takes_no_shipped_agents_name_and_says_where_it_has_no_agent(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command = ("tune", "panda_reach", "--output", "panda_reach", *QUICK)
    assert drs(*command, "--stop-after", 1).returncode == 0
    assert drs(*command, "--resume").returncode == 0
    tuned, shipped = (
        only_json(drs("evaluate", name, "--episodes", 2, "--json")) for name in ("./panda_reach", "panda_reach")
    )
    assert tuned["action_change_mean"] != shipped["action_change_mean"]
    (tmp_path / "panda_reach" / "agent.safetensors").unlink()
    refused(drs("evaluate", "./panda_reach"), "No update is done yet")
    refused(drs("evaluate", "x" * 300 + ".safetensors"), "x.safetensors")


def test_one_episode_has_no_interval(agent_file, tmp_path):
    # which is better in this episode
    make_agent(seed=1).save(other := tmp_path / "other.safetensors")
    one = only_json(drs("compare", agent_file, other, "--episodes", 1, "--workers", 0, "--json"))
    assert one["before"]["return_ci95"] is None and one["differences"]["return"]["ci95"] is None
    assert one["probability_after_better"] is None
    assert one["episodes_equal"] == 0
    text = drs("compare", agent_file, other, "--episodes", 1, "--workers", 0).stdout
    # the cells of P(after better) are empty
    assert "one episode has no interval" in text and not re.search(r"[01]\.000 *│", text)
