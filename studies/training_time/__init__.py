"""How good is a training after how long?"""

RESULTS = ("python -m studies.training_time --json studies/training_time/results/fast.json",)

TABLES = (
    (
        "table",
        "fast.json",
        "",
        "recipe",
        "minutes_max=longest, min",
        "worst_abs_median_error_m*1000=worst error, mm",
    ),
)
