"""Training: recipes, checkpoints that survive a kill, choice of snapshots, policy files."""
