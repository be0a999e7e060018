"""What does continued training on a leg bring?"""

RESULTS = (
    "python -m studies.finetuning --twins 1 2 --seeds 0 1 --minutes 5 --figure "
    "studies/finetuning/figures/finetuning.svg --json "
    "studies/finetuning/results/finetuning.json",
)
