"""What a rollout costs: this project, its peers and the physics alone, measured in turn in one run."""
