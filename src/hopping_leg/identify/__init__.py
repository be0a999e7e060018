"""From recorded trajectories to a robot file (paper, "Simulation to Reality Transfer")."""
