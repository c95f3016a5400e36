"""Every environment of the paper runs on topics; what is not of ROS is tested without it."""

from __future__ import annotations

import numpy as np
import pytest

from drs.dispatch import batch_size, is_late
from drs.stream import Stream
from drs.stream_driver import Pace
from drs_core.environments import PAPER
from drs_core.errors import UsageError


@pytest.mark.parametrize("environment", PAPER)
def test_it_steps_and_begins_again(environment: str) -> None:
    stream = Stream(environment)
    first = stream.reset(3)
    assert (first.count, first.seed, first.done) == (0, 3, False)
    assert (first.state is not None) == (environment.startswith("Panda") or "Bullet" in environment)
    frame = stream.step(None)
    assert frame.time_s == pytest.approx(first.time_s + stream.period_s)
    for _ in range(stream.environment.spaces.time_limit_steps):
        if frame.done or frame.count > 100:
            break
        frame = stream.step(stream.environment.spaces.high)
    if frame.done:
        assert stream.step(None).seed == 4
    stream.close()


def test_without_a_command_the_arm_stays() -> None:
    for interface in ("action", "joint_command", "target_pose"):
        stream = Stream("PandaReach-v3", interface)
        start = stream.reset(0).state.tip_position
        for _ in range(25):
            frame = stream.step(None)
        assert np.abs(frame.state.tip_position - start).max() < 0.01, interface
        stream.close()


def test_only_a_panda_takes_arm_commands() -> None:
    with pytest.raises(UsageError, match="for MountainCarContinuous-v0 use action"):
        Stream("MountainCarContinuous-v0", "joint_command")
    with pytest.raises(UsageError, match="no command interface 'thought'"):
        Stream("PandaReach-v3", "thought")


def test_a_call_lasts_half_a_second_and_shrinks_towards_the_end() -> None:
    assert batch_size(100, 2, None) == 1
    assert batch_size(100, 2, 0.05) == 10
    assert batch_size(8, 2, 0.05) == 2
    assert batch_size(100, 2, 3.0) == 1
    assert batch_size(0, 2, 0.05) == 0


def test_an_idle_simulator_takes_over_what_is_late() -> None:
    assert not is_late(1.0, 0.5)
    assert is_late(2.1, 0.5)


def test_pace() -> None:
    assert Pace(2.0, False).tick_s(0.04) == pytest.approx(0.02)
    assert Pace(0.0, True).by_command and not Pace(1.0, True).by_command
