"""What does a search over the numbers of `fast` find?"""

RESULTS = (
    "hop tune fast --trials 20 --steps 1000000 --workers 2 --json studies/tuning/results/fast.json",
    "cp runs/tune/fast/*.svg studies/tuning/figures",
)
