"""Is the leg safe whatever fails?"""

RESULTS = (
    "python -m studies.fault_campaign --repeats 10 --live 2 --controllers fast precise "
    "energy-shaping --json studies/fault_campaign/results/fault_campaign.json",
)

TABLES = (
    (
        "table",
        "fault_campaign.json",
        "",
        "trials",
        "unsafe",
        "live_trials=in real time",
        "disturbed_trials=ended early as the computer was busy",
        "reaction_max_s*1000=slowest reaction, ms",
        "host_death_to_brake_max_s*1000=dead host to brake, ms",
    ),
)
