"""Run the study: ``python -m studies.finetuning --help``."""

import sys

from studies.finetuning.run import Finetune
from studies.shared import main

if __name__ == "__main__":
    sys.exit(main("finetuning", Finetune))
