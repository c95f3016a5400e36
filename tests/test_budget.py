"""Robot time as a number of updates: nothing that a run does is left out, and no update more would fit."""

import json

import hypothesis
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from drs_core import json_lines
from drs_core.budget import LEAST_S, MOST_S, Budget, budget_from, duration, parse_duration, plan
from drs_core.environments import Timing
from drs_core.errors import UsageError
from drs_core.objective import BASELINE_EPISODES
from drs_core.rollouts import InProcess, Task
from drs_core.tune_config import tune_config
from drs_core.tuning import Tuning
from tests.conftest import drs, make_agent, refused
from tests.test_tuning import Silent

REACH = Timing(0.04, 50)
AGENT = make_agent()
(EPISODE,) = InProcess(AGENT).run(AGENT.theta, [Task(0)])


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("90s", 90),
        ("20min", 1200),
        ("1h", 3600),
        ("1h30min", 5400),
        ("1h 30min 5s", 5405),
        (" 1.5h ", 5400),
        ("1 h", 3600),
    ],
)
def test_a_duration(text, seconds):
    assert parse_duration(text) == seconds


@pytest.mark.parametrize(
    "text",
    [
        *["", " ", "20", "min", "20m", "-1h", "1h-5s", "30min1h", "1e3s", "nans", "infs", "1h1h", "\u0661h"],
        *["0s", "0.9s", "10001h", "9" * 5000 + "s", "1" * 59 + "s", "1h" + " " * 5000],
    ],
)
def test_what_is_no_duration_is_refused_with_an_example(text):
    with pytest.raises(UsageError, match=r"90s, 20min|1s to 10000h") as error:
        parse_duration(text)
    assert len(str(error.value)) < 250


@given(st.text(max_size=80) | st.text("0123456789.hmins ", max_size=30))
@example("1h30min")
def test_any_text_is_a_duration_in_range_or_refused(text):
    try:
        found = parse_duration(text)
    except UsageError:
        return
    assert LEAST_S <= found <= MOST_S


@given(st.integers(1, int(MOST_S)))
def test_a_duration_is_written_as_it_is_read(seconds):
    assert parse_duration(duration(seconds)) == seconds


def settings():
    return st.fixed_dictionaries(
        {
            "directions": st.integers(1, 70),
            "evaluate_every": st.integers(0, 12),
            "evaluation_episodes": st.integers(1, 200),
            "objective": st.sampled_from(["return", "smooth"]),
        }
    )


def spent(values, updates):
    """Episodes of a run, counted update by update."""
    every, episodes = values["evaluate_every"], BASELINE_EPISODES if values["objective"] == "smooth" else 0
    # judged by 20 updates, and to go on from there takes one more
    episodes += BASELINE_EPISODES if values.get("back_off") and updates > 20 else 0
    for done in range(updates + 1):
        if done:
            episodes += 2 * values["directions"]
        if every and done % every == 0:
            episodes += values["evaluation_episodes"]
    return episodes


@given(
    settings(),
    st.booleans(),
    st.integers(1, 20_000),
    st.floats(0, 60),
    st.sampled_from([(0.04, 50), (0.0165, 1000), (1 / 30, 999)]),
)
def test_a_plan_spends_its_budget_and_one_update_more_would_not_fit(values, back_off, episodes, reset_s, clock):
    values |= {"back_off": back_off and values["evaluate_every"] > 0}
    clock = Timing(*clock)
    each_s = clock.episode_s + reset_s
    config = tune_config(values)
    if episodes * each_s > MOST_S or episodes * each_s < LEAST_S:
        return
    try:
        found = plan(Budget(episodes * each_s, reset_s), clock, config)
    except UsageError as error:
        assert episodes < spent(values, 1)
        least = parse_duration(str(error).split("give at least ")[1].split(",")[0])
        assert plan(Budget(least, reset_s), clock, config).config.search.updates >= 1
        return
    updates = found.config.search.updates
    assert found.episodes == spent(values, updates) <= episodes < spent(values, updates + 1)


def test_more_updates_than_a_run_has_are_refused_with_the_most_that_are_not():
    config, clock = tune_config({"directions": 1}), Timing(0.04, 50)
    with pytest.raises(UsageError, match=r"10000h pays for [0-9]+ updates, and 1000000 are the most") as refusal:
        plan(Budget(3.6e7), clock, config)
    most = parse_duration(str(refusal.value).split("give at most ")[1].split(",")[0])
    assert plan(Budget(most), clock, config).config.search.updates == 1_000_000


@hypothesis.settings(deadline=None, max_examples=25)
@given(values=settings(), updates=st.integers(1, 12))
def test_a_run_of_the_planned_updates_runs_the_planned_episodes(values, updates, tmp_path_factory):
    """What is counted is what `Tuning` really asks for."""
    values |= {"directions": min(values["directions"], 3), "evaluation_episodes": min(values["evaluation_episodes"], 4)}
    count = 0

    class Counting(InProcess):
        def run(self, theta, tasks, progress=None):
            nonlocal count
            count += len(tasks)
            return [EPISODE] * len(tasks)

    budget = Budget(spent(values, updates) * REACH.episode_s)
    found = plan(budget, REACH, tune_config(values))
    assert found.config.search.updates == updates
    Tuning(AGENT, "agent", found.config, tmp_path_factory.mktemp("run") / "run").run(Counting(AGENT), Silent())
    assert count == found.episodes


def test_the_sentence_says_everything_that_counts():
    config = tune_config({"objective": "smooth", "directions": 8, "evaluate_every": 5})
    sentence = plan(Budget(1200.0, 1.0), REACH, config).sentence()
    for part in ("20min", "18 updates of 2 x 8", "4 evaluations of 20", "32 of the baseline", "400 episodes", "2 s"):
        assert part in sentence
    for part in ("50 steps at 25 Hz", "1 s between them, 20min."):
        assert part in sentence


def test_an_empty_budget_is_none_as_it_is_for_a_node():
    assert budget_from({"budget": "", "reset_seconds": 3.0}) is None and budget_from({}) is None


@pytest.mark.parametrize("reset_s", [-1.0, float("nan"), 3601.0])
def test_a_reset_time_out_of_range_is_refused(reset_s):
    with pytest.raises(UsageError, match="0 to 3600"):
        budget_from({"budget": "1h", "reset_seconds": reset_s})


@pytest.fixture
def car(tmp_path):
    path = tmp_path / "car.safetensors"
    AGENT.save(path)
    return path


FEW = ("--directions", 2, "--evaluate-every", 2, "--evaluation-episodes", 3, "--workers", 0)


def test_a_budget_is_a_run_of_so_many_updates(car, tmp_path):
    """10 minutes of 33.3 s are 18 episodes: 3 updates of 4 and 2 evaluations of 3."""
    result = drs("tune", car, "--output", tmp_path / "a", "--budget", "10min", *FEW, "--json")
    assert result.returncode == 0, result.stderr
    assert "A budget of 10min pays for 3 updates of 2 x 2 episodes, 2 evaluations of 3: 18 episodes" in " ".join(
        result.stderr.split()
    )
    assert json.loads(result.stdout)["updates"] == json.loads(result.stdout)["updates_done"] == 3
    assert drs("tune", car, "--output", tmp_path / "b", "--updates", 3, *FEW).returncode == 0
    for name in ("agent.safetensors", "best.safetensors", "evaluations.jsonl", "run.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_it_is_continued_with_the_same_budget_or_with_the_updates_that_it_came_to(car, tmp_path):
    first = drs("tune", car, "--output", tmp_path / "a", "--budget", "10min", *FEW, "--stop-after", 1)
    assert first.returncode == 0, first.stderr
    again = drs("tune", car, "--output", tmp_path / "a", "--budget", "10min", *FEW, "--stop-after", 2, "--resume")
    assert again.returncode == 0, again.stderr
    last = drs("tune", car, "--output", tmp_path / "a", "--updates", 3, *FEW, "--resume")
    assert last.returncode == 0, last.stderr
    assert [record["update"] for record in json_lines.read(tmp_path / "a" / "history.jsonl")] == [1, 2, 3]
    other = drs("tune", car, "--output", tmp_path / "a", "--budget", "1h", *FEW, "--resume")
    refused(other, "updates = 3, not")


def test_an_option_wins_over_a_file_whichever_of_the_two_it_is(car, tmp_path):
    file = tmp_path / "params.yaml"
    file.write_text("/**: {ros__parameters: {budget: 10min, reset_seconds: 5.0}}\n")
    result = drs("tune", car, "--output", tmp_path / "a", "--params", file, "--updates", 1, *FEW, "--json")
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["updates"] == 1 and "budget" not in result.stderr
    result = drs("tune", car, "--output", tmp_path / "b", "--params", file, *FEW, "--json")
    assert result.returncode == 0, result.stderr
    assert "5 s between them" in " ".join(result.stderr.split())
    file.write_text("/**: {ros__parameters: {updates: 1}}\n")
    result = drs("tune", car, "--output", tmp_path / "c", "--params", file, "--budget", "10min", *FEW, "--json")
    assert json.loads(result.stdout)["updates"] == 3


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--budget", "10min", "--updates", 3], ["--budget 10min", "--updates 3", "one of them"]),
        (["--budget", "soon"], ["'soon'", "20min"]),
        (["--budget", ""], ["20min"]),
        (["--budget", "10s"], ["10s", "too small", "7 episodes", "3min54s"]),
        (["--budget", "10min", "--reset-seconds", -1], ["reset_seconds", "0 to 3600"]),
        (["--reset-seconds", 1], ["--reset-seconds 1", "--budget"]),
    ],
)
def test_wrong_use_is_refused_before_anything_is_made(car, tmp_path, options, words):
    refused(drs("tune", car, "--output", tmp_path / "a", *options, *FEW), *words)
    assert not (tmp_path / "a").exists()
