"""Baselines of our own, trained with Stable-Baselines3 and sb3-contrib."""

from drs_core.training.train import TrainConfig, train

__all__ = ["TrainConfig", "train"]
