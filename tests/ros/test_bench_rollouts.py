"""The ROS 2 side of `drs bench`, through the same door."""

from drs_core.bench.variants import chosen
from drs_core.rollouts import InProcess, Task
from tests.conftest import make_agent


def test_turns_over_two_nodes_run_the_episode_asked_for():
    agent = make_agent()
    variant = chosen(("ros",))["ros"].make(agent)
    try:
        first, second = variant.run(5, 1), variant.run(5, 1)
    finally:
        variant.close()
    here = InProcess(agent)
    length = here.run(agent.theta, [Task(5)])[0].length
    here.close()
    for sample in (first, second):
        assert sample.rollouts == 8 and sample.steps == 8 * length
        assert sample.cpu_s > 0 and sample.wall_s > 0
