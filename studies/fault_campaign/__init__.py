"""Is the leg safe whatever fails?"""

_TRY = "python -m studies.fault_campaign --controllers fast precise energy-shaping"

_LIES = "'dead encoder' 'frozen sample' 'stale samples' 'false torque' 'false velocity'"
_LIES += " 'swapped replies' 'one id for two' 'fast clock' 'lie and fault'"

RESULTS = (
    f"{_TRY} --repeats 417 --live 0 --json studies/fault_campaign/results/fault_campaign.json",
    f"{_TRY} --repeats 10 --live 2 --json studies/fault_campaign/results/real_time.json",
    "python -m studies.fault_campaign --controllers fast energy-shaping universal --live 0"
    f" --seed 11 --repeats 125 --families {_LIES} --json studies/fault_campaign/results/lies.json",
    "python -m studies.fault_campaign --controllers fast precise universal paper energy-shaping"
    " --live 0 --seed 11 --repeats 175 --families 'no fault'"
    " --json studies/fault_campaign/results/healthy.json",
)
