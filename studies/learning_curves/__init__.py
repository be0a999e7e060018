"""How do trials during a training of the paper's recipe go?"""

RESULTS = (
    "hop train --recipe paper --out runs/paper-seed0",
    "hop train --recipe paper --set privileged_critic=false --out runs/paper-blind",
    "python -m studies.learning_curves recipe=runs/paper-seed0 'critics on "
    "measurements=runs/paper-blind' --json studies/learning_curves/results/paper.json",
)

TABLES = (
    (
        "table",
        "paper.json",
        "last",
        "setting",
        "steps",
        "minutes",
        "median_error_0.25_m*1000=error at 0.25 m, mm",
        "median_error_0.30_m*1000=at 0.30 m",
        "median_error_0.35_m*1000=at 0.35 m",
    ),
)
