"""Do controllers hop in another physics engine as well?"""

RESULTS = ("python -m studies.engines --json studies/engines/results/engines.json",)
