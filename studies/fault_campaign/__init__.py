"""Is the leg safe whatever fails?"""

_TRY = "python -m studies.fault_campaign --controllers fast precise energy-shaping"

RESULTS = (
    f"{_TRY} --repeats 417 --live 0 --json studies/fault_campaign/results/fault_campaign.json",
    f"{_TRY} --repeats 10 --live 2 --json studies/fault_campaign/results/real_time.json",
)
