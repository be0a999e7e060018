"""The fault campaign: what the host does about everything that can go wrong, trial by trial."""
