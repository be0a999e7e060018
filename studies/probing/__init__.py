"""What do policies know of contact, phase and height?"""

RESULTS = (
    "python -m studies.probing fast precise adaptive recurrent paper --figure "
    "studies/probing/figures/probing.svg --json studies/probing/results/probing.json",
)

TABLES = (
    ("pivot", "probing.json", "rows", "features", "target", "{score:.2f}", {"controller": "fast"}),
)
