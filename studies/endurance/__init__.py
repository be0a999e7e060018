"""Does a controller hop for ten minutes on emulated drives without the supervisor ending it?"""

RESULTS = (
    "python -m studies.endurance --controllers precise --commands 0.22 0.26 0.38 0.42 "
    "--json studies/endurance/results/endurance.json",
)

TABLES = (
    (
        "table",
        "endurance.json",
        "rows",
        "controller",
        "command_m=command, m",
        "reason",
        "seconds",
        "median_error_m*1000=error, mm",
        "std_m*1000=std, mm",
        "skipped_hops=skipped hops",
        "hottest_c=hottest drive, degrees C",
        "rms_hip_torque_nm=hip RMS, N m",
        "rms_knee_torque_nm=knee RMS, N m",
    ),
)
