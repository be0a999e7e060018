"""What limits accuracy?"""

RESULTS = (
    "python -m studies.limits --controllers precise adaptive recurrent energy-shaping "
    "quarter=runs/bench-quarter/precise-seed3/policy.onnx --teacher "
    "runs/bench-quarter/precise-seed3/start-1 --json studies/limits/results/limits.json",
)
