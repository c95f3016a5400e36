import subprocess
import sys

import pytest

from drs_core.environments import Environment, describe
from drs_core.environments.catalogue import PAPER
from drs_core.errors import UsageError


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("NoSuchEnv-v0", "NoSuchEnv"),
        ("CartPole-v1", "only a Box"),
        ("os:system-v0", "not an environment id"),
        ("../x", "no environment"),
        ("", "not an environment id"),
    ],
)
def test_what_cannot_be_made_is_refused(name, word):
    with pytest.raises(UsageError, match=word):
        Environment(name)


def test_other_gymnasium_ids_work_to_their_time_limit():
    environment = Environment("Pendulum-v1")
    environment.reset(0)
    steps = 1
    while not environment.step(environment.spaces.high).truncated:
        steps += 1
    assert steps == environment.spaces.time_limit_steps == 200
    environment.close()


def test_box2d_success_is_an_ending_without_crash():
    for name in ("BipedalWalker-v3", "LunarLanderContinuous-v3"):
        success = PAPER[name].success
        assert success(True, -100, {}) is False
        assert success(True, 100, {}) is True
        assert success(False, 1.0, {}) is False


def test_nothing_reaches_the_terminal_and_no_torch_is_imported():
    program = (
        "from drs_core.environments import Environment; import sys\n"
        "for name in ('PandaReach-v3', 'HopperBulletEnv-v0'):\n"
        "    e = Environment(name); e.reset(0); e.close()\n"
        "assert 'torch' not in sys.modules and 'matplotlib' not in sys.modules\n"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert result.stdout == "" and result.stderr == ""


def test_spaces_of_a_dict_environment():
    spaces = describe("PandaPickAndPlace-v3")
    assert spaces.parts == {"achieved_goal": 3, "desired_goal": 3, "observation": 19}
    assert list(spaces.low) == [-1] * 4 and spaces.time_limit_steps == 50 and spaces.is_dict
