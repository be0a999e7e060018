"""Does kill -9 at any moment change a result, or leave something behind?"""

RESULTS = ("python -m studies.kills --json studies/kills/results/kills.json",)

TABLES = (
    (
        "table",
        "kills.json",
        "rows",
        "verb",
        "kills",
        "differences",
        "left_processes=processes left",
        "left_files=temporary files left",
        "seconds=undisturbed, s",
    ),
)
