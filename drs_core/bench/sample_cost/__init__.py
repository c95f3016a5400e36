"""How many rollouts an agent needs until its return is the paper's: ``drs bench --sample-cost``."""
