"""Do the lab's recorded hops come out in simulation?"""

RESULTS = (
    "python -m studies.real_hops --figure studies/real_hops/figures/real_hops.svg --json "
    "studies/real_hops/results/real_hops.json",
)

TABLES = (
    (
        "table",
        "real_hops.json",
        "rows",
        "rig",
        "robot",
        "hops",
        "apex_mean_m*1000=apex, mm, mean error",
        "apex_rms_m*1000=rms",
        "push_mean_s*1000=push-off, ms, mean error",
        "push_rms_s*1000=rms of it",
        "flight_mean_s*1000=flight, ms, mean error",
        "flight_rms_s*1000=rms of that",
        "torque_rms_nm=torques, N m, rms error",
        "torque_gain=gain",
        "extra=kg or N",
    ),
)
