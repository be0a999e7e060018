"""Is the leg safe whatever fails?"""

_TRY = "python -m studies.fault_campaign --controllers fast precise energy-shaping"

RESULTS = (
    f"{_TRY} --repeats 417 --live 0 --json studies/fault_campaign/results/fault_campaign.json",
    f"{_TRY} --repeats 10 --live 2 --json studies/fault_campaign/results/real_time.json",
)

TABLES = (
    (
        "table",
        "fault_campaign.json",
        "",
        "trials",
        "unsafe",
        "host_death_to_brake_max_s*1000=dead host to brake, ms",
    ),
    (
        "table",
        "real_time.json",
        "",
        "trials",
        "unsafe",
        "live_trials=in real time",
        "disturbed_trials=ended early as the computer was busy",
        "reaction_max_s*1000=slowest reaction, ms",
        "host_death_to_brake_max_s*1000=dead host to brake, ms",
    ),
)
