"""When a run counts as flat, what it then leaves, and that a resumed run decides the same."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core import json_lines, tuning
from drs_core.episode import Episode
from drs_core.errors import UsageError
from drs_core.search import SearchConfig
from drs_core.stopping import RULE, Flat, FlatRule, flat
from drs_core.tune_config import TuneConfig
from drs_core.tuning import Tuning
from tests.conftest import drs, make_agent, refused
from tests.test_tuning import Silent, same

AGENT = make_agent("Pendulum-v1")
EPISODE = Episode(0, 0.0, 10, False, False, None, 0.0)
STILL = TuneConfig(
    # with a step of 0 every evaluation is the same
    SearchConfig(updates=20, directions=1, alpha=(0.0, 0.0), sigma=(0.3, 0.3)),
    evaluate_every=1,
    evaluation_episodes=2,
)
STOPS_AFTER = RULE.least - 1


def records(objectives):
    """Objectives (evaluations, episodes) as records of a run that evaluates every other update."""
    return [{"update": 2 * at, "objectives": list(map(float, row))} for at, row in enumerate(objectives)]


def curve(gains, spread=1.0, hover=0.0, seed=0, episodes=20):
    """Evaluations whose mean follows `gains`, in episodes that differ by `spread`; theta hovers by `hover`."""
    rng = np.random.default_rng(seed)
    gains = np.asarray(gains, dtype=float)
    noise = np.r_[0.0, rng.normal(0.0, hover, len(gains) - 1)] if hover else np.zeros(len(gains))
    return gains[:, None] + noise[:, None] + rng.normal(0.0, spread, episodes)


@settings(deadline=None)
@given(st.integers(2, 200), st.floats(0.1, 10.0))
def test_steady_growth_is_never_flat(count, gain):
    assert flat(records(curve(np.linspace(0.0, gain * count, count)))) is None


@settings(deadline=None)
@given(st.integers(1, 20), st.floats(0.0, 10.0))
def test_growth_that_has_ended_is_flat_in_the_end_and_says_since_when(steps, gain):
    found = [flat(records(curve(np.minimum(np.arange(n) / steps, 1.0) * gain))) for n in range(2, 3 * steps + 15)]
    assert found[-1] is not None
    first = next(result for result in found if result)
    assert first.older < first.newer <= first.update and first.most <= first.allowed


@settings(deadline=None)
@given(st.integers(0, 30))
def test_a_few_evaluations_never_suffice(count):
    assert (flat(records(np.zeros((count, 3)))) is not None) == (count >= RULE.least)


@settings(deadline=None)
@given(st.integers(0, 1000), st.integers(-20, 20), st.integers(-3, 3), st.permutations(range(6)))
def test_units_and_the_order_of_episodes_do_not_matter(seed, shift, power, order):
    rng = np.random.default_rng(seed)
    # small whole numbers, and factors that are powers of two, so that the sums round alike
    some = rng.integers(0, 8, (18, 6)).astype(float)
    here, there = flat(records(some)), flat(records((some[:, order] + shift) * 2.0**power))
    assert (here is None) == (there is None)
    if here and there:
        assert there.most == pytest.approx(here.most * 2.0**power)


def test_the_errors_of_episodes_and_of_hovering_both_keep_it_from_stopping():
    still = curve(np.zeros(30))
    assert flat(records(still)) is not None
    episodes = still + np.random.default_rng(1).normal(0.0, 3.0, still.shape)
    assert flat(records(episodes)) is None
    assert flat(records(still + np.random.default_rng(1).normal(0.0, 1.0, (30, 1)))) is None


def test_few_runs_that_grow_to_the_end_are_stopped():
    """Growth of two standard deviations of the baseline, hovering by a third of one: 300 runs of 40 evaluations."""
    stopped = 0
    for seed in range(300):
        objectives = curve(np.linspace(0.0, 2.0, 41), hover=0.3, seed=seed)
        stopped += any(flat(records(objectives[:n])) for n in range(RULE.least, 41))
    assert stopped <= 45


def test_the_decision_is_the_same_from_disk(tmp_path):
    rng = np.random.default_rng(3)
    for n in range(40):
        some = records(np.cumsum(rng.normal(0.0, 0.1, (18, 5)), axis=0) * (n % 7))
        path = tmp_path / f"{n}.jsonl"
        for record in some:
            json_lines.append(path, record)
        assert flat(json_lines.read(path)) == flat(some)


def test_records_of_older_versions_are_passed_over():
    old = [{"update": at, "objective_mean": 1.0} for at in range(5)]
    new = records(np.zeros((RULE.least, 3)))
    assert flat(old + new[1:]) is None
    assert flat(old + new) == flat(new) != None  # noqa: E711


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4),
)


@settings(deadline=None)
@given(st.lists(json_values, min_size=RULE.least, max_size=RULE.least + 3))
def test_damaged_objectives_are_refused_with_a_sentence(wild):
    damaged = [{"update": at, "objectives": value} for at, value in enumerate(wild)]
    try:
        assert flat(damaged) is None or isinstance(flat(damaged), Flat)
    except UsageError as error:
        assert "evaluations.jsonl" in str(error)


@pytest.mark.parametrize(
    ("settings", "words"),
    [((200, 0, 20), "evaluate_every 0 gives 0"), ((200, 20, 20), "gives 11 in 200"), ((20, 1, 1), "not 1")],
)
def test_settings_that_give_too_little_to_go_by_are_refused(settings, words):
    RULE.check(200, 10, 20)
    with pytest.raises(UsageError, match=words):
        RULE.check(*settings)


class Counting:
    """Episodes whose return is their seed's alone; counts them, and is Ctrl-C in batch `at`."""

    def __init__(self, at=-1):
        self.left, self.episodes = at, 0

    def run(self, theta, tasks, progress=None):
        self.left -= 1
        if self.left == -1:
            raise KeyboardInterrupt
        self.episodes += len(tasks)
        return [replace(EPISODE, seed=task.seed, return_=float(task.seed % 97)) for task in tasks]


def tune(path, rollouts=None, stop_after=None, resume=False, config=STILL, stop_when_flat=True):
    run = Tuning(AGENT, "agent", config, path, resume, stop_when_flat=stop_when_flat)
    run.run(rollouts or Counting(), Silent(), stop_after)
    return run


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    path = tmp_path_factory.mktemp("stopped") / "run"
    tune(path)
    return path


def test_a_flat_run_ends_without_a_rollout_too_many_and_says_why(tmp_path):
    rollouts = Counting()
    run = tune(tmp_path, rollouts)
    assert run.done == STOPS_AFTER
    assert rollouts.episodes == 2 * STOPS_AFTER + 2 * RULE.least
    assert run.flat is not None and f"Flat after update {STOPS_AFTER}" in run.flat.sentence()


def test_what_it_leaves_is_what_a_run_leaves_that_is_stopped_there(tmp_path, stopped):
    tune(tmp_path, stop_after=STOPS_AFTER, stop_when_flat=False)
    same(tmp_path, stopped)


def test_resumed_it_stops_again_at_once(tmp_path):
    tune(tmp_path)
    rollouts = Counting()
    again = tune(tmp_path, rollouts, resume=True)
    assert (again.done, rollouts.episodes) == (STOPS_AFTER, 0) and again.flat is not None


def test_without_the_option_it_goes_on_to_the_end_as_if_it_had_never_stopped(tmp_path):
    tune(tmp_path / "stopped")
    assert tune(tmp_path / "stopped", resume=True, stop_when_flat=False).done == 20
    tune(tmp_path / "straight", stop_when_flat=False)
    same(tmp_path / "stopped", tmp_path / "straight")


@pytest.mark.parametrize("at", [0, 1, 2 * STOPS_AFTER - 1, 2 * STOPS_AFTER])
def test_interrupted_and_resumed_it_stops_at_the_same_update(tmp_path, stopped, at):
    with pytest.raises(KeyboardInterrupt):
        tune(tmp_path, Counting(at))
    assert tune(tmp_path, resume=True).done == STOPS_AFTER
    same(tmp_path, stopped)


def test_a_run_that_grows_is_not_touched(tmp_path):
    """The rule only looks on: the same bits, though evaluations run in batches of their own."""
    growing = replace(STILL, search=replace(STILL.search, alpha=(0.3, 0.3), updates=4, directions=3))
    never = replace(growing, search=replace(growing.search, updates=RULE.least + 1))
    for name, stop_when_flat in (("a", True), ("b", False)):
        tune(tmp_path / name, config=never, stop_after=4, stop_when_flat=stop_when_flat)
    same(tmp_path / "a", tmp_path / "b")


def test_a_folder_of_an_older_version_is_continued_and_judged_from_then_on(tmp_path):
    tune(tmp_path, stop_after=3)
    path = tmp_path / "evaluations.jsonl"
    old = [{key: value for key, value in record.items() if key != "objectives"} for record in json_lines.read(path)]
    path.write_text("".join(json.dumps(record) + "\n" for record in old))
    assert tune(tmp_path, resume=True).done == 3 + RULE.least


def test_a_record_keeps_each_episodes_objective_up_to_a_number(tmp_path, monkeypatch):
    monkeypatch.setattr(tuning, "MOST_OBJECTIVES_KEPT", 3)
    for episodes in (2, 5):
        folder = tmp_path / str(episodes)
        tune(folder, stop_after=1, config=replace(STILL, evaluation_episodes=episodes))
        (record, _) = json_lines.read(folder / "evaluations.jsonl")
        assert len(record["objectives"]) == min(episodes, 3)
        if episodes == 2:
            assert np.mean(record["objectives"]) == record["objective_mean"]


def test_a_rule_of_other_constants():
    objectives = records(np.zeros((6, 2)))
    assert flat(objectives) is None and flat(objectives, FlatRule(least=6)) is not None


FEW = ("--updates", 20, "--directions", 1, "--alpha", 0, 0, "--evaluate-every", 1, "--evaluation-episodes", 2)


@pytest.fixture
def car(tmp_path):
    path = tmp_path / "car.safetensors"
    AGENT.save(path)
    return path


def test_on_the_command_line(car, tmp_path):
    command = ("tune", car, "--output", tmp_path / "run", *FEW, "--workers", 0)
    result = drs(*command, "--stop-when-flat")
    assert result.returncode == 0, result.stderr
    said = " ".join(result.stdout.split())
    assert f"Flat after update {STOPS_AFTER}: " in said and "best.safetensors; --resume without the option" in said
    result = drs(*command, "--stop-when-flat", "--resume", "--json")
    found = json.loads(result.stdout)
    assert found["updates_done"] == STOPS_AFTER and found["flat"].startswith("Flat after")
    result = drs(*command, "--resume", "--json")
    found = json.loads(result.stdout)
    assert found["updates_done"] == 20 and found["flat"] is None


def test_by_a_parameter_file_and_an_option_over_it(car, tmp_path):
    file = tmp_path / "params.yaml"
    file.write_text("/**: {ros__parameters: {stop_when_flat: true}}\n")
    command = ("tune", car, "--params", file, *FEW, "--workers", 0, "--json")
    assert json.loads(drs(*command, "--output", tmp_path / "a").stdout)["updates_done"] == STOPS_AFTER
    result = drs(*command, "--output", tmp_path / "b", "--no-stop-when-flat")
    assert json.loads(result.stdout)["updates_done"] == 20


def test_too_few_evaluations_are_refused_before_anything_is_made(car, tmp_path):
    result = drs("tune", car, "--output", tmp_path / "run", "--updates", 20, "--stop-when-flat", "--workers", 0)
    refused(result, "stop_when_flat", "evaluate_every 10", "more often")
    assert not (tmp_path / "run").exists()
