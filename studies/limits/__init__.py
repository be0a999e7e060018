"""What limits accuracy?"""

RESULTS = (
    "python -m studies.limits --controllers precise adaptive recurrent energy-shaping "
    "quarter=runs/bench-quarter/precise-seed3/policy.onnx --teacher "
    "runs/bench-quarter/precise-seed3/start-1 --json studies/limits/results/limits.json",
)

TABLES = (
    (
        "table",
        "limits.json",
        "rows",
        "controller",
        "condition",
        "mean_abs_median_error_m*1000=error, mm",
        "mean_std_m*1000=std, mm",
    ),
)
