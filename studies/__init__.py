"""Studies of the leg and of this package, each run by ``python -m studies.NAME``."""
