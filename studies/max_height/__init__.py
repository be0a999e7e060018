"""How high could the leg hop with its torques?"""

RESULTS = ("python -m studies.max_height --json studies/max_height/results/max_height.json",)

TABLES = (
    (
        "table",
        "max_height.json",
        "rows",
        "hip_limit_nm=hip, N m",
        "knee_limit_nm=knee, N m",
        "apex_m=apex, m",
        "hop_rate_hz=hops/s",
        "rms_knee_torque_nm=RMS at the knee, N m",
    ),
)
