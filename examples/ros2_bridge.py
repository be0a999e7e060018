"""Let a controller drive a leg through ROS 2: /joint_states in, efforts on /joint_commands out.

Run it as ``python examples/ros2_bridge.py [CONTROLLER] [HEIGHT]`` where ROS 2 is sourced; a
std_msgs/Float64 on /command_m changes the height. No supervisor stands behind it as behind
``hop deploy``: late samples end in zero torque, and nothing else does. Try it on a simulator.
"""

import sys
from collections import deque

import numpy as np

from hopping_leg.controllers.protocol import SAMPLES, Measurement
from hopping_leg.controllers.registry import load_controller, robot_of
from hopping_leg.robot import CONTROL_RATE, JOINTS, load_robot

LATEST = 0.05  # age of the newest sample beyond which no torque is asked for, s


class Bridge:
    """Feeds samples with their ages to a controller, at its rate."""

    def __init__(self, node, joint_state, number, controller, height):
        self.node, self.joint_state, self.controller = node, joint_state, controller
        self.samples, self.height = deque(maxlen=SAMPLES), height
        controller.reset(1)
        node.create_subscription(joint_state, "/joint_states", self.see, 10)
        node.create_subscription(
            number, "/command_m", lambda m: setattr(self, "height", m.data), 10
        )
        self.publisher = node.create_publisher(joint_state, "/joint_commands", 10)
        node.create_timer(1 / CONTROL_RATE, self.act)

    def see(self, message):
        places = [message.name.index(joint) for joint in JOINTS]
        q, qd = (np.array(values)[places] for values in (message.position, message.velocity))
        stamp = message.header.stamp
        self.samples.appendleft((stamp.sec + 1e-9 * stamp.nanosec, q, qd))

    def act(self):
        if not self.samples:
            return
        taken, q, qd = zip(*self.samples, *[self.samples[-1]] * (SAMPLES - len(self.samples)))
        age = 1e-9 * self.node.get_clock().now().nanoseconds - np.array([taken])
        heights = np.full((1, SAMPLES), self.height)
        torque = self.controller.act(Measurement(np.array([q]), np.array([qd]), heights, age))
        late = age[0, 0] > LATEST
        effort = [0.0, 0.0] if late else torque[0].tolist()
        self.publisher.publish(self.joint_state(name=list(JOINTS), effort=effort))


if __name__ == "__main__":
    import rclpy
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64

    name, height = *sys.argv[1:], *("fast", "0.3")[len(sys.argv) - 1 :]
    rclpy.init()
    node, leg = rclpy.create_node("hopping_leg"), load_robot(robot_of([name]))
    Bridge(node, JointState, Float64, load_controller(name, leg), float(height))
    print(f"{name} drives {leg.name} at {height} m; Ctrl-C ends it.")
    rclpy.spin(node)
