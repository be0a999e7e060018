"""How long does it take from scratch to accurate hopping?"""

RESULTS = (
    "python -m studies.time_to_accuracy --json "
    "studies/time_to_accuracy/results/time_to_accuracy.json --figure "
    "studies/time_to_accuracy/figures/time_to_accuracy.svg",
)

TABLES = (
    (
        "table",
        "time_to_accuracy.json",
        "summary",
        "recipe",
        "seconds=seconds",
        "runs",
        "worst_seed_mean_error_m*1000=error of the worst seed, mm",
        "mean_error_m*1000=error, mm",
        "mean_std_m*1000=std, mm",
        "skipped_hops=skipped hops",
    ),
    (
        "table",
        "time_to_accuracy.json",
        "spent",
        "recipe",
        "part",
        "seconds",
    ),
)
