"""The paper's tables again: baseline, tuning, evaluation, and our numbers beside the printed ones."""
