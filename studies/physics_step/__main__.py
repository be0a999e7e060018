"""Run the study: ``python -m studies.physics_step --help``."""

from studies.physics_step.run import PhysicsStep
from studies.shared import main

if __name__ == "__main__":
    raise SystemExit(main("physics_step", PhysicsStep))
