"""The robot driven for real: the way to its drives, supervisor, control loop, flight recorder."""
