"""What is each part of energy shaping worth?"""

RESULTS = (
    "python -m studies.energy_shaping --json studies/energy_shaping/results/energy_shaping.json",
    "python -m studies.energy_shaping.tune --start energy-shaping-flying-legv2 --flight 0.5 "
    "--generations 60 --population 16 --step 0.08 --commands 0.22 0.25 0.29 0.33 0.36 "
    "--out runs/flying --json studies/energy_shaping/results/flying.json",
)
