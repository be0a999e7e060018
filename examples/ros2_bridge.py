"""Let a controller drive a leg through ROS 2: /joint_states in, efforts on /joint_commands out.

``python examples/ros2_bridge.py [CONTROLLER] [HEIGHT]`` where ROS 2 is sourced; /command_m, a
Float64, changes the height. No supervisor guards it: late samples alone end in zero torque.
"""

import sys
from collections import deque
from typing import Any

import numpy as np

from hopping_leg.controllers.protocol import SAMPLES, Controller, Measurement
from hopping_leg.controllers.registry import load_controller, robot_of
from hopping_leg.robot import CONTROL_RATE, JOINTS, load_robot

LATEST = 0.05  # age of the newest sample beyond which no torque is asked for, s
Ros = Any


class Bridge:
    """Gives samples with their ages to a controller."""

    def __init__(self, node: Ros, joint_state: Ros, controller: Controller, height: float) -> None:
        self.node, self.joint_state, self.controller = node, joint_state, controller
        self.samples, self.height, _ = deque(maxlen=SAMPLES), height, controller.reset(1)
        node.create_subscription(joint_state, "/joint_states", self.see, 10)
        self.publisher = node.create_publisher(joint_state, "/joint_commands", 10)
        node.create_timer(1 / CONTROL_RATE, self.act)

    def see(self, message: Ros) -> None:
        """Keep a sample of both joints, whatever their order."""
        at, stamp = [message.name.index(joint) for joint in JOINTS], message.header.stamp
        q, qd = np.array([message.position, message.velocity])[:, at]
        self.samples.appendleft((stamp.sec + 1e-9 * stamp.nanosec, q, qd))

    def act(self) -> None:
        """Ask for torques by the newest samples; of the first there are three."""
        while 0 < len(self.samples) < SAMPLES:
            self.samples.append(self.samples[-1])
        taken, q, qd = (np.array([[s[part] for s in self.samples]]) for part in range(3))
        if taken.size:
            age, command = 1e-9 * self.node.get_clock().now().nanoseconds - taken, 0 * taken
            torque = self.controller.act(Measurement(q, qd, command + self.height, age))
            effort = [0.0, 0.0] if age[0, 0] > LATEST else torque[0].tolist()
            self.publisher.publish(self.joint_state(name=list(JOINTS), effort=effort))


if __name__ == "__main__":
    import rclpy
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64

    name, height = *sys.argv[1:], *("fast", "0.3")[len(sys.argv) - 1 :]
    rclpy.init()
    node, leg = rclpy.create_node("hopping_leg"), load_robot(robot_of([name]))
    bridge = Bridge(node, JointState, load_controller(name, leg), float(height))
    node.create_subscription(Float64, "/command_m", lambda m: setattr(bridge, "height", m.data), 10)
    print(f"{name} drives {leg.name} at {height} m; Ctrl-C ends it.")
    rclpy.spin(node)
