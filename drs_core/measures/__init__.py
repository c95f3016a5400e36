"""Measures of an episode and of many: pure functions of arrays."""
