"""How good is a training after how long?"""

RESULTS = (
    "python -m studies.training_time --json studies/training_time/results/fast.json",
    "python -m studies.training_time --recipe precise --parallel-seeds 2 --threads 1 "
    "--minutes 13.5 --steps 20000000 --training-seeds 0 1 2 3 4 --out runs/bench-quarter "
    "--json studies/training_time/results/precise.json",
    "hop evaluate precise quarter-seed0=runs/bench-quarter/precise-seed0/policy.onnx "
    "quarter-seed1=runs/bench-quarter/precise-seed1/policy.onnx "
    "quarter-seed2=runs/bench-quarter/precise-seed2/policy.onnx "
    "quarter-seed3=runs/bench-quarter/precise-seed3/policy.onnx "
    "quarter-seed4=runs/bench-quarter/precise-seed4/policy.onnx --seeds 5 --floor soft "
    "--no-video --commands "
    "0.22,0.23,0.24,0.25,0.26,0.27,0.28,0.29,0.3,0.31,0.32,0.33,0.34,0.35,0.36,0.37,0.38,0.39,0.4,"
    "0.41,0.42,0.43,0.44,0.45 "
    "--json studies/training_time/results/precise_hops.json",
)

TABLES = (
    (
        "table",
        "fast.json",
        "",
        "recipe",
        "minutes_max=longest, min",
        "worst_abs_median_error_m*1000=worst error, mm",
    ),
    (
        "table",
        "precise.json",
        "",
        "recipe",
        "minutes_max=longest, min",
        "worst_abs_median_error_m*1000=worst error, mm",
    ),
)
