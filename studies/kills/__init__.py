"""Does kill -9 at any moment change a result, or leave something behind?"""

RESULTS = (
    "python -m studies.kills --verbs evaluate tune --kills 30"
    " --json studies/kills/results/kills.json",
    "python -m studies.kills --verbs train sim_to_real --kills 10"
    " --json studies/kills/results/kills_ten.json",
)

TABLES = tuple(
    (
        "table",
        file,
        "rows",
        "verb",
        "kills",
        "differences",
        "left_processes=processes left",
        "left_files=temporary files left",
        "seconds=undisturbed, s",
    )
    for file in ("kills.json", "kills_ten.json")
)
