"""A node for rclpy: odometry, scan and goal in, cmd_vel out, planned by `kmpc_lite.Controller`.

    python3 kmpc_node.py --ros-args -p model:=robot.npz -p radius:=0.2 -p v_max:=0.3

A car is given its `turning_radius`, and its `wheelbase` if it obeys AckermannDriveStamped instead
of Twist (rename the topic with -r cmd_vel:=drive); an omni `omni`.

It has no safety gate, no TF and no map, which `kmpc ros2` has: goals are in the frame of the
odometry, and the robot's base must stop by itself when no command comes.
"""

import math

import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan

import kmpc_lite as kl

UNKNOWN = (math.nan, math.nan, math.nan)  # of an unknown pose the controller makes a stop


def nominal(wheels):
    """Model of a robot that no log is learned of."""
    return kl.nominal_omni(0.1) if wheels.inputs == 3 else kl.nominal_unicycle(0.1)


def planar(pose):
    """Position and heading (x, y, theta) of a geometry_msgs/Pose."""
    q = pose.orientation
    return pose.position.x, pose.position.y, 2.0 * math.atan2(q.z, q.w)


class KmpcNode(Node):
    """Keeps the newest message of each topic, and plans in every period."""

    def __init__(self):
        super().__init__("kmpc")
        path, v, omega = self.ask("model", ""), self.ask("v_max", 0.3), self.ask("omega_max", 0.8)
        turning, self.wheelbase = self.ask("turning_radius", 0.0), self.ask("wheelbase", 0.0)
        wheels = kl.Omni() if self.ask("omni", False) else kl.Differential()
        wheels = kl.Car(turning) if turning else wheels
        model = kl.KoopmanModel.load(path) if path else nominal(wheels)
        fastest = (v, v, omega) if wheels.inputs == 3 else (v, omega)
        problem = kl.NavigationProblem(
            dt=model.dt,
            u_min=[-speed for speed in fastest],
            u_max=fastest,
            robot_radius=self.ask("radius", 0.2),
            wheels=wheels,
        )
        self.controller = kl.Controller(model, problem)
        self.mount = self.ask("scanner", [0.0, 0.0, 0.0])  # x, y, heading on the robot
        self.oldest = self.ask("oldest", 0.3)  # age of a message that is still used [s]
        self.newest = {Odometry: None, LaserScan: None, PoseStamped: None}
        for kind, topic in ((Odometry, "odom"), (LaserScan, "scan"), (PoseStamped, "goal_pose")):
            quality = qos_profile_sensor_data if kind is LaserScan else 10
            self.create_subscription(kind, topic, self.take, quality)
        self.kind = Twist
        if self.wheelbase:  # apt install ros-jazzy-ackermann-msgs
            from ackermann_msgs.msg import AckermannDriveStamped

            self.kind = AckermannDriveStamped
        self.angle = 0.0  # of the front wheels, which stay as they are while the car stands
        self.commands = self.create_publisher(self.kind, "cmd_vel", 10)
        self.create_timer(model.dt, self.step)

    def ask(self, name, default):
        """Value of a parameter."""
        return self.declare_parameter(name, default).value

    def take(self, message):
        """Keep a message."""
        self.newest[type(message)] = message

    def age(self, header):
        """Age of a message [s]."""
        now = self.get_clock().now().nanoseconds
        return 1e-9 * (now - header.stamp.nanosec) - header.stamp.sec

    def step(self):
        """Publish a command."""
        odometry, scan, goal = self.newest.values()
        if goal is None or odometry is None or scan is None:
            return
        if goal.header.frame_id != odometry.header.frame_id:
            self.get_logger().error(f"goals must be in {odometry.header.frame_id!r}")
            self.newest[PoseStamped] = None
            return
        ages = self.age(odometry.header), self.age(scan.header)
        pose, seen = UNKNOWN, []
        if max(ages) < self.oldest:
            pose = planar(odometry.pose.pose)
            angles = scan.angle_min, scan.angle_increment, scan.range_max, scan.range_min
            age = max(0.0, ages[1] - ages[0])  # when the scan was made, the robot stood elsewhere
            seen = [kl.LaserScan(scan.ranges, *angles, mount=self.mount, age=age)]
        plan = self.controller.step(pose, planar(goal.pose), seen)
        self.commands.publish(self.message(*map(float, plan.command)))
        if plan.reason:
            self.get_logger().info(plan.reason, throttle_duration_sec=2.0)

    def message(self, v, *rest):
        """Command of the wheels that this robot has: v and omega, or v_x, v_y and omega."""
        command = self.kind()
        if self.wheelbase:
            self.angle = math.atan(self.wheelbase * rest[0] / v) if v else self.angle
            command.header.stamp = self.get_clock().now().to_msg()
            command.drive.speed, command.drive.steering_angle = v, self.angle
            return command
        command.linear.x, command.angular.z = v, rest[-1]
        command.linear.y = rest[0] if len(rest) > 1 else 0.0
        return command


def main():
    rclpy.init()
    rclpy.spin(KmpcNode())


if __name__ == "__main__":
    main()
