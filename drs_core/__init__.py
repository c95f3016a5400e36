"""Fine tuning of reinforcement-learning policies by direct random search, without ROS."""

__version__ = "0.1.0"
