"""From an agent's action to a command that a real arm may be given: inputs, kinematics, limits, guards; no ROS."""
