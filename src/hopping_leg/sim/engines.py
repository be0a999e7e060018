"""The same leg in either engine."""

from hopping_leg.errors import UsageError
from hopping_leg.robot import TIMESTEP, Robot
from hopping_leg.sim.mujoco_simulator import MujocoSimulator
from hopping_leg.sim.simulator import CONTROL_RATE, Engine, Ground, Simulator


def make_simulator(
    robot: Robot,
    count: int,
    *,
    engine: Engine = "mujoco",
    ground: Ground = "robot",
    rate: float = CONTROL_RATE,
    timestep: float = TIMESTEP,
    threads: int = 0,
) -> Simulator:
    """Return legs in the engine asked for.

    Args:
        robot: The leg.
        count: Number of simulations n.
        engine: What computes the physics.
        ground: What the foot stands on.
        rate: Control rate, Hz.
        timestep: Physics step, s; must divide the control period.
        threads: MuJoCo's worker threads, 0 for one per core; PyBullet has one.

    Raises:
        UsageError: Engine and ground do not go together, or the engine refuses the robot.
    """
    check_ground(engine, ground)
    if engine == "mujoco":
        return MujocoSimulator(robot, count, rate=rate, timestep=timestep, threads=threads)
    # What runs on the robot shall not import what only PyBullet needs.
    from hopping_leg.sim.pybullet import PyBulletSimulator

    return PyBulletSimulator(robot, count, rate=rate, timestep=timestep, ground=ground)


def check_ground(engine: Engine, ground: Ground) -> None:
    """Refuse what MuJoCo has not.

    Raises:
        UsageError: Engine and ground do not go together.
    """
    if engine == "mujoco" and ground != "robot":
        raise UsageError(
            f"MuJoCo has no ground '{ground}', only 'robot'; take the engine pybullet, or a robot"
            " with another contact."
        )
