"""How well and how fast are legs identified?"""

RESULTS = (
    "hop record multisine --robot legv2 --centre 0.7 -1.4 --amplitude 0.3 0.4 --out "
    "runs/results/multisine.parquet",
    "hop record play runs/results/multisine.parquet --robot twin --believed legv2 "
    "--out runs/results",
    "hop identify runs/results/twin-multisine.parquet --out runs/results/identified.toml "
    "--json studies/identification/results/identify.json",
    "python -m studies.identification --parts synthetic --json "
    "studies/identification/results/known_legs.json",
    "python -m studies.identification --parts coverage --json "
    "studies/identification/results/coverage.json",
    "python -m studies.identification --parts paper-size --searches two-pass --json "
    "studies/identification/results/paper_size.json",
    "python -m studies.identification --parts recordings --json "
    "studies/identification/results/recordings.json",
    "python -m studies.identification.real_leg --out "
    "src/hopping_leg/robot/robots/legv2-identified.toml --json "
    "studies/identification/results/real_leg.json",
)
