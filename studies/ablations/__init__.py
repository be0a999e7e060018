"""What is each part of a distillation worth, and what do other teachers teach?"""

RESULTS = (
    "python -m studies.ablations --seeds 0 1 --steps 600000 --json "
    "studies/ablations/results/ablations.json",
)

TABLES = (
    (
        "table",
        "ablations.json",
        "variants",
        "meaning=variant",
        "runs",
        "mean_abs_median_error_m*1000=error, mm",
        "worst_abs_median_error_m*1000=worst, mm",
        "mean_std_m*1000=std, mm",
        "skipped_hops=skipped hops",
        "body_contact_ticks=body contact, ticks",
    ),
)
