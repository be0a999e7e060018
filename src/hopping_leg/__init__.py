"""End-to-end reinforcement learning for torque-based, variable-height hopping of one leg."""
