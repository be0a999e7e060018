"""Judge controllers, everyone's, on the same legs: twins that nobody has seen, and changed ones.

A submission is a folder in `submissions/`; how to add one stands in the README. All meet the same
drawn twins of the leg, and the axes of RealAIGym's robustness leaderboard, with the same seeds. A
trial is successful where no hop is skipped and the median apex is within 20 mm of the command.
What is judged already is kept: the same command goes on after an interruption, and a new submission
costs only its own time.

Examples:
  python -m studies.leaderboard --json leaderboard.json
  python -m studies.leaderboard fast energy-shaping --twins 4 --seeds 1
"""

RESULTS = ("python -m studies.leaderboard --json studies/leaderboard/results/leaderboard.json",)

TABLES = (
    (
        "table",
        "leaderboard.json",
        "submissions",
        "submission",
        "twins*100=twins, %",
        "twins_low*100=from",
        "twins_high*100=to",
        "median_abs_error_m*1000=error, mm",
        "skipped_hops=skipped hops",
        "body_contacts=body contacts",
        "robustness*100=changed legs, %",
        "robustness_low*100=from",
        "robustness_high*100=to",
        "robot=knows the leg as",
        "authors",
    ),
    (
        "pivot",
        "leaderboard.json",
        "scores",
        "axis",
        "submission",
        "{score:.0%} [{low:.0%}, {high:.0%}]",
    ),
)
