"""What does continued training on a leg bring?"""

RESULTS = (
    "python -m studies.finetuning --twins 0 1 2 3 --seeds 0 1 --minutes 4 --figure "
    "studies/finetuning/figures/finetuning.svg --json "
    "studies/finetuning/results/finetuning.json",
)

TABLES = (
    (
        "table",
        "finetuning.json",
        "rows",
        "twin",
        "policy",
        "policies",
        "median_abs_error_m*1000=error, mm",
        "best_m*1000=best",
        "worst_m*1000=worst",
    ),
)
