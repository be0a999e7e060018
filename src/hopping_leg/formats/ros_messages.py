"""How a trace and ROS 2 messages correspond: topics, joints, columns.

Measured joints are ``sensor_msgs/JointState`` on ``/joint_states``, their commands the same on
``/joint_commands``; every other number of a trace is a ``std_msgs/Float64`` on the topic of its
column. Joints are named as in the leg's URDF; the rail's position is the base height.
"""

JOINT_STATE = "sensor_msgs/msg/JointState"
FLOAT = "std_msgs/msg/Float64"

DEFINITIONS = {
    JOINT_STATE: """\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
""",
    FLOAT: "float64 data\n",
}
"""Fields of the messages that are written and read, as ROS 2 defines them."""

STATES = "joint_states"
COMMANDS = "joint_commands"
QUANTITIES = ("position", "velocity", "effort")
"""Arrays of a ``JointState``."""

COLUMNS = {
    STATES: {
        "rail": ("height_m", "height_rate_m_s", ""),
        "hip": ("hip_position_rad", "hip_velocity_rad_s", "hip_torque_nm"),
        "knee": ("knee_position_rad", "knee_velocity_rad_s", "knee_torque_nm"),
    },
    COMMANDS: {
        joint: (
            f"{joint}_position_command_rad",
            f"{joint}_velocity_command_rad_s",
            f"{joint}_command_nm",
        )
        for joint in ("hip", "knee")
    },
}
"""Columns of a trace or recording by topic and joint, in the order of ``QUANTITIES``."""

NAMES = {
    column: f"{topic}/{joint}.{quantity}"
    for topic, joints in COLUMNS.items()
    for joint, columns in joints.items()
    for quantity, column in zip(QUANTITIES, columns, strict=True)
    if column
}
"""What a bag's own columns are called for each of a recording's."""

KEY = "hopping_leg"
"""Metadata record of an MCAP file that holds a trace's header as JSON."""
