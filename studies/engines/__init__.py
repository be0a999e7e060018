"""Do controllers hop in another physics engine as well?"""

RESULTS = ("python -m studies.engines --json studies/engines/results/engines.json",)

TABLES = (
    (
        "table",
        "engines.json",
        "rows",
        "engine",
        "controller",
        "command_m=command, m",
        "median_error_m*1000=error, mm",
        "std_m*1000=std, mm",
        "hops",
    ),
)
