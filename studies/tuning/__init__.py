"""What does a search over the numbers of `fast` find?"""

RESULTS = (
    "hop tune fast --trials 20 --steps 500000 --workers 2 --out runs/tune/fast --json "
    "studies/tuning/results/fast.json",
    "mkdir -p studies/tuning/figures && cp runs/tune/fast/*.svg studies/tuning/figures",
)

TABLES = (
    ("table", "fast.json", "trials", "number=trial", "state", "score_m*1000=score, mm", "minutes"),
)
