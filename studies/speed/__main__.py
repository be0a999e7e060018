"""Run a part of the study: ``python -m studies.speed --help``."""

import sys

from studies.shared import main
from studies.speed.deploy_options import Deploy
from studies.speed.env_options import Env
from studies.speed.inference_options import Inference
from studies.speed.view_options import View

if __name__ == "__main__":
    sys.exit(main("speed", Env | Inference | View | Deploy))
