"""What is each part of a recipe worth?"""

RESULTS = (
    "python -m studies.ablations --json studies/ablations/results/fast.json",
    "python -m studies.ablations --recipe precise --steps 9000000 --threads 1 --variants "
    "recipe no-teacher short-past jumpy-teacher no-aim all-heights-alike --json "
    "studies/ablations/results/precise.json",
)
