"""Run a part of the study: ``python -m studies.speed --help``."""

from studies.shared import main
from studies.speed.deploy import Deploy
from studies.speed.env import Env

if __name__ == "__main__":
    raise SystemExit(main("speed", Env | Deploy))
