"""What is each part of a distillation worth, and what do other teachers teach?"""

RESULTS = (
    "python -m studies.ablations --seeds 0 1 --steps 600000 --json "
    "studies/ablations/results/ablations.json",
)
