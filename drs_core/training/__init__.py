"""Baselines of our own, trained with Stable-Baselines3 and sb3-contrib."""
