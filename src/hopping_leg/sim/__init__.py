"""The leg simulated: many legs at once at the control rate, with noise and delay."""

from hopping_leg.errors import UsageError
from hopping_leg.robot import TIMESTEP, Robot
from hopping_leg.sim.channel import NO_NOISE, SAMPLES, Channel, Measurement, NoiseAndDelay
from hopping_leg.sim.leg_simulator import LegSimulator, compile_physics
from hopping_leg.sim.mujoco_simulator import MujocoSimulator
from hopping_leg.sim.plant import Plant, SoftLimiter
from hopping_leg.sim.simulator import CONTROL_RATE, Engine, Ground, Simulator
from hopping_leg.sim.stepper import LOADS

__all__ = [
    "CONTROL_RATE",
    "LOADS",
    "NO_NOISE",
    "SAMPLES",
    "Channel",
    "Engine",
    "Ground",
    "LegSimulator",
    "Measurement",
    "NoiseAndDelay",
    "Plant",
    "Simulator",
    "SoftLimiter",
    "check_ground",
    "compile_physics",
    "make_simulator",
]


def make_simulator(
    robot: Robot,
    count: int,
    *,
    engine: Engine = "stepper",
    ground: Ground = "robot",
    rate: float = CONTROL_RATE,
    timestep: float = TIMESTEP,
    threads: int = 0,
) -> Simulator:
    """Return legs in the engine and on the ground asked for.

    ``rate`` is the control rate, Hz, whose period the physics step, s, must divide. Stepper and
    MuJoCo have ``threads``, 0 for one per core; PyBullet has one.

    Raises:
        UsageError: Engine and ground do not go together, or the engine refuses the robot.
    """
    check_ground(engine, ground)
    if engine == "stepper":
        return LegSimulator(robot, count, rate=rate, timestep=timestep, threads=threads)
    if engine == "mujoco":
        return MujocoSimulator(robot, count, rate=rate, timestep=timestep, threads=threads)
    # What runs on the robot shall not import what only PyBullet needs.
    from hopping_leg.sim.pybullet import PyBulletSimulator

    return PyBulletSimulator(robot, count, rate=rate, timestep=timestep, ground=ground)


def check_ground(engine: Engine, ground: Ground) -> None:
    """Refuse a ground that only PyBullet has.

    Raises:
        UsageError: Engine and ground do not go together.
    """
    if engine != "pybullet" and ground != "robot":
        raise UsageError(
            f"The engine {engine} has no ground '{ground}', only 'robot'; take the engine pybullet,"
            " or a robot with another contact."
        )
