"""Is the leg safe whatever fails?"""

_TRY = "python -m studies.fault_campaign --controllers fast rl energy-shaping"

_SHOWN = "'dropped reply' 'corrupted reply' 'late reply' 'duplicated reply' 'total loss'"
_SHOWN += " 'garbage line' 'encoder jump' 'encoder drift' 'drive fault' over-temperature"
_SHOWN += " over-voltage under-voltage 'limit notice' 'adapter unplugged' 'drive restarted'"
_SHOWN += " 'fault while arming' 'fault at lift-off' 'fault while sinking' 'double fault'"
_SHOWN += " 'stalled host' 'killed host' 'wrong boot pose' 'wrong wiring' 'wrong configuration'"
_LIVE = "'encoder jump' 'drive fault' over-temperature over-voltage under-voltage"
_LIVE += " 'drive restarted' 'killed host'"
_LIES = "'dead encoder' 'frozen sample' 'stale samples' 'false torque' 'false velocity'"
_LIES += " 'swapped replies' 'one id for two' 'fast clock' 'lie and fault'"

RESULTS = (
    f"{_TRY} --repeats 21 --live 0 --families {_SHOWN}"
    " --json studies/fault_campaign/results/fault_campaign.json",
    f"{_TRY} --repeats 10 --live 2 --families {_LIVE}"
    " --json studies/fault_campaign/results/real_time.json",
    "python -m studies.fault_campaign --controllers fast energy-shaping universal --live 0"
    f" --seed 12 --repeats 60 --families {_LIES}"
    " --json studies/fault_campaign/results/lies.json",
    "python -m studies.fault_campaign --controllers fast rl universal paper energy-shaping"
    " --live 0 --seed 11 --repeats 50 --families 'no fault'"
    " --json studies/fault_campaign/results/healthy.json",
)
