"""How do trials during a training of the paper's recipe go?"""

RESULTS = (
    "hop train --recipe paper --out runs/paper-seed0",
    "hop train --recipe paper --set privileged_critic=false --out runs/paper-blind",
    "python -m studies.learning_curves recipe=runs/paper-seed0 'critics on "
    "measurements=runs/paper-blind' --json studies/learning_curves/results/paper.json",
)
