"""Recordings of a ROS 2 graph as MCAP files, without ROS: written, read back, replayed to an agent."""
