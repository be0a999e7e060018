"""Do controllers hop in another physics engine as well?"""

RESULTS = ("python -m studies.engines --json studies/engines/results/engines.json",)

TABLES = (
    (
        "table",
        "engines.json",
        "worlds",
        "world",
        "controller",
        "largest_median_error_m*1000=largest error, mm",
        "mean_std_m*1000=std, mm",
        "skipped_hops=skipped hops",
        "ordered=heights in order",
    ),
)
