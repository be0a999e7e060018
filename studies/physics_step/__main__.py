"""Run the study: ``python -m studies.physics_step --help``."""

import sys

from studies.physics_step.run import PhysicsStep
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("physics_step", PhysicsStep))
