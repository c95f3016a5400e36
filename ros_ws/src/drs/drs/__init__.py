"""The ROS 2 side of drs: nodes, and the conversions between messages and the library."""
