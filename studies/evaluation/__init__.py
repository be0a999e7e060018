"""Results of `hop evaluate`, `hop robustness` and `hop skills` for the shipped controllers."""

RESULTS = (
    "hop evaluate fast precise adaptive paper energy-shaping energy-shaping-literal "
    "--seeds 10 --no-video --traces runs/results/traces --json "
    "studies/evaluation/results/evaluation.json",
    "hop report figures runs/results/traces/*.parquet --out studies/evaluation/figures",
    "hop evaluate precise adaptive recurrent energy-shaping energy-shaping-flying --seeds "
    "5 --floor soft --no-video --commands "
    "0.22,0.23,0.24,0.25,0.26,0.27,0.28,0.29,0.3,0.31,0.32,0.33,0.34,0.35,0.36,0.37,0.38,0.39,0.4 "
    "--json studies/evaluation/results/precise.json",
    "hop robustness energy-shaping energy-shaping-literal fast precise adaptive recurrent "
    "paper --seeds 3 --out runs/results/robustness --json "
    "studies/evaluation/results/robustness.json",
    "cp runs/results/robustness/robustness.svg studies/evaluation/figures",
    "hop skills fast precise adaptive paper energy-shaping --json "
    "studies/evaluation/results/skills.json",
)
