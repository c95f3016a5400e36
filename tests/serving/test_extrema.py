"""How far a plan goes is told exactly, whatever state it begins in."""

from __future__ import annotations

import numpy as np
import ruckig
from hypothesis import given, settings
from hypothesis import strategies as st

from drs_core.serving.extrema import profile_extrema

number = st.floats(-3.0, 3.0)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.tuples(number, number, number, number), min_size=2, max_size=2),
    st.sampled_from(["Position", "Velocity"]),
    st.sampled_from([1.0, 5.0, 500.0]),
)
def test_it_is_what_fine_sampling_finds(joints, interface, max_jerk):
    problem = ruckig.InputParameter(2)
    problem.control_interface = getattr(ruckig.ControlInterface, interface)
    problem.current_position, problem.current_velocity, problem.current_acceleration, problem.target_position = map(
        list, zip(*joints)
    )
    problem.target_velocity = problem.target_acceleration = [0.0, 0.0]
    problem.max_velocity, problem.max_acceleration, problem.max_jerk = [2.0] * 2, [4.0] * 2, [max_jerk] * 2
    plan = ruckig.Trajectory(2)
    ruckig.Ruckig(2).calculate(problem, plan)
    times = np.linspace(0.0, plan.duration, 2000)
    sampled = np.array([plan.at_time(t)[0] for t in times])
    for joint, profile in enumerate(plan.profiles[0]):
        low, high = profile_extrema(profile)
        path = sampled[:, joint]
        assert low <= path.min() + 1e-9 and high >= path.max() - 1e-9
        # between two samples at a turn: a h^2 / 8, with the acceleration that states above begin with
        slack = 10.0 * (times[1] - times[0]) ** 2 + 1e-9
        assert low >= path.min() - slack and high <= path.max() + slack
