"""What a task gives in place of its episodes is a sentence, and the one of its cause."""

from __future__ import annotations

import pytest

from drs_core.episode import Episode
from drs_core.errors import DrsError, UsageError
from drs_core.ray_rollouts.failures import checked, explained, plain
from drs_core.ray_rollouts.messages import Answer

EPISODES = [Episode(seed, 1.0, 1, False, False, None, 0.0) for seed in (3, 4)]


@pytest.mark.parametrize("seeds", [[3], [3, 4, 5], [4, 3]])
def test_other_episodes_than_were_asked_for_are_not_used(seeds: list[int]) -> None:
    assert checked(Answer(EPISODES), [3, 4]).episodes == EPISODES
    with pytest.raises(DrsError, match=rf"gave 2 episodes, not those of the {len(seeds)} seeds"):
        checked(Answer(EPISODES), seeds)


def test_an_error_keeps_its_kind() -> None:
    with pytest.raises(UsageError, match="a wrong name"):
        checked(Answer((), error="a wrong name", exit_status=2), [3, 4])
    with pytest.raises(DrsError, match="its report:\nTraceback"):
        checked(Answer((), error="Traceback"), [3, 4])


def test_only_what_was_lost_is_called_lost() -> None:
    exceptions = pytest.importorskip("ray", reason="Ray is not installed").exceptions
    for lost in (
        exceptions.WorkerCrashedError(),
        exceptions.NodeDiedError("its machine is gone"),
        exceptions.OutOfMemoryError("too much"),
        exceptions.ObjectLostError("00" * 28, "", ""),
    ):
        assert "lost 10 times" in explained(lost, exceptions, 10)
    raised = exceptions.RayTaskError("run_batch", "\x1b[36mray::run_batch()\x1b[39m\nKeyError: 1", KeyError(1))
    assert explained(raised, exceptions, 10) == "A task failed on the cluster: KeyError: 1"
    no_environment = exceptions.RuntimeEnvSetupError("\x1b[31mpip\x1b[0m has no such package")
    told = explained(no_environment, exceptions, 10)
    assert told.startswith("Ray could not run a task: RuntimeEnvSetupError") and "no such package" in told
    assert "lost" not in told and "\x1b" not in told


def test_of_a_traceback_the_last_line_is_told_and_of_others_all() -> None:
    assert plain(RuntimeError("Version mismatch: the cluster has\n  Ray 2.40\nPython: 3.11.7")) == (
        "Version mismatch: the cluster has Ray 2.40 Python: 3.11.7"
    )
    assert plain(RuntimeError("Traceback:\n  File\n\x1b[1mValueError\x1b[0m: no\n\n")) == "ValueError: no"
    assert plain(RuntimeError()) == "RuntimeError" and len(plain(RuntimeError("x" * 9999))) == 300
