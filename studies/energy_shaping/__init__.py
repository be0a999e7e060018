"""What is each part of energy shaping worth?"""

RESULTS = (
    "python -m studies.energy_shaping --json studies/energy_shaping/results/energy_shaping.json",
    "python -m studies.energy_shaping.tune --start energy-shaping-flying-legv2 --flight 0.5 "
    "--generations 60 --population 16 --step 0.08 --commands 0.22 0.25 0.29 0.33 0.36 "
    "--out runs/flying --json studies/energy_shaping/results/flying.json",
    "python -m studies.energy_shaping.tune --robot legv2 --start by-hand --twins 10 --seed 500 "
    "--commands 0.22 0.26 0.30 0.34 0.38 --seconds 5 --population 20 --generations 200 "
    "--out runs/tune-twins --json studies/energy_shaping/results/tuned.json",
)
