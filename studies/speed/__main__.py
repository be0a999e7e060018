"""Run a part of the study: ``python -m studies.speed --help``."""

import sys

from studies.shared import main
from studies.speed.deploy import Deploy
from studies.speed.env import Env
from studies.speed.inference import Inference
from studies.speed.view import View

if __name__ == "__main__":
    sys.exit(main("speed", Env | Inference | View | Deploy))
