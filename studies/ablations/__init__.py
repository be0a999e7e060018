"""What is each part of a distillation worth?"""

RESULTS = (
    "python -m studies.ablations --seeds 0 1 --json studies/ablations/results/ablations.json",
)
