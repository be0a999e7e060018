"""What is each part of a recipe worth?"""

RESULTS = (
    "python -m studies.ablations --json studies/ablations/results/fast.json",
    "python -m studies.ablations --recipe precise --steps 9000000 --threads 1 --variants "
    "recipe no-teacher short-past jumpy-teacher no-aim all-heights-alike --json "
    "studies/ablations/results/precise.json",
)

TABLES = (
    (
        "table",
        "fast.json",
        "rows",
        "meaning=variant",
        "command_m=command, m",
        "median_error_m*1000=error, mm",
        "std_m*1000=std, mm",
        "skipped_hops=skipped hops",
    ),
    (
        "table",
        "precise.json",
        "variants",
        "meaning=variant",
        "mean_abs_median_error_m*1000=error, mm",
        "std_m*1000=std, mm",
        "skipped_hops=skipped hops",
    ),
)
