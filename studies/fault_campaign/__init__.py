"""Is the leg safe whatever fails?"""

RESULTS = (
    "python -m studies.fault_campaign --repeats 15 --live 2 --controllers fast precise "
    "energy-shaping --json studies/fault_campaign/results/fault_campaign.json",
)
