"""What hops shall the teacher show, and how high does it reach?"""

RESULTS = (
    "python -m studies.mpc reach --json studies/mpc/results/reach.json",
    "python -m studies.mpc search --generations 20 --population 10 --json "
    "studies/mpc/results/search.json",
)

TABLES = (
    (
        "table",
        "reach.json",
        "rows",
        "robot",
        "command_m=command, m",
        "median_error_m*1000=error, mm",
        "std_m*1000=std, mm",
        "flight_fraction*100=flight, %",
        "rms_hip_torque_nm=hip RMS, N m",
        "mean_power_w=power, W",
        "peak_knee_speed_rad_s=knee at most, rad/s",
    ),
    ("table", "search.json", "shape", "name=number", "shipped", "found"),
)
