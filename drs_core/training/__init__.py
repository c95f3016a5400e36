"""Baselines of our own, trained with Stable-Baselines3 and sb3-contrib."""

from drs_core.training.config import TrainConfig
from drs_core.training.train import CHECKPOINT_MINUTES, Trained, train

__all__ = ["CHECKPOINT_MINUTES", "TrainConfig", "Trained", "train"]
