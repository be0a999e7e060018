"""Do the lab's recorded hops come out in simulation?"""

RESULTS = (
    "python -m studies.real_hops --figure studies/real_hops/figures/real_hops.svg --json "
    "studies/real_hops/results/real_hops.json",
)
