"""`python -m hopping_leg.cli` is `hop`."""

import sys

from hopping_leg.cli import main

sys.exit(main())
