"""Run the study: ``python -m studies.fault_campaign --help``."""

from studies.fault_campaign.campaign import Faults
from studies.shared import main

if __name__ == "__main__":
    raise SystemExit(main("fault_campaign", Faults))
