"""A ROS 2 node by rclpy, in a process of its own: prints what it receives, publishes what it is asked to.

Lines of standard input are JSON, such as ``{"hand": {"name": ["closure"], "position": [0.5]}}``, or ``{"arm": ...}``
with ``position`` and ``orientation``; each is published at 50 Hz until the next one. ``"ahead_s"`` moves the time of
the header, ``"stamp": false`` leaves it at zero, ``null`` ends publishing.
"""

from __future__ import annotations

from typing import Any

import rclpy
from geometry_msgs.msg import PoseStamped, WrenchStamped
from peer_lines import asked, fields_of, say  # type: ignore[import-not-found]  # in this folder
from rclpy.duration import Duration
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CompressedImage, JointState
from std_msgs.msg import String

HEARD = {
    "/hand/joints": (JointState, 10),
    "/tactile/thumb/image": (CompressedImage, qos_profile_sensor_data),
    "/tactile/thumb/wrench": (WrenchStamped, 10),
    "/run/state/text": (String, 10),
}


def graph(node: Any) -> dict[str, Any]:
    """Return type hashes and QoS of all publishers but this node's, and of this node's subscriptions."""
    found: dict[str, Any] = {}
    for topic, _ in node.get_topic_names_and_types():
        for info in node.get_publishers_info_by_topic(topic):
            if info.node_name != node.get_name():
                qos = [info.qos_profile.reliability.name, info.qos_profile.durability.name]
                found[topic] = [info.topic_type, str(info.topic_type_hash), *qos]
    own = {
        topic: str(info.topic_type_hash)
        for topic in HEARD
        for info in node.get_subscriptions_info_by_topic(topic)
        if info.node_name == node.get_name()
    }
    return {"publishers": found, "own_hashes": own}


def main() -> None:
    requested = asked()
    rclpy.init()
    node = rclpy.create_node("tega_test_peer")

    def subscribe(topic: str, kind: Any, qos: Any) -> None:
        node.create_subscription(kind, topic, lambda m: say(topic=topic, **fields_of(m)), qos)

    for topic, (kind, qos) in HEARD.items():
        subscribe(topic, kind, qos)
    hand = node.create_publisher(JointState, "/hand/target", 10)
    arm = node.create_publisher(PoseStamped, "/forearm", 10)
    now: dict[str, Any] = {}

    def stamped(message: Any, wanted: dict[str, Any]) -> Any:
        if wanted.get("stamp", True):
            ahead = Duration(seconds=wanted.get("ahead_s", 0.0))
            message.header.stamp = (node.get_clock().now() + ahead).to_msg()
        return message

    def publish() -> None:
        while not requested.empty():
            now.update(requested.get())
            if "graph" in now:
                say(graph=graph(node), topic=now.pop("graph"))
        if (wanted := now.get("hand")) is not None:
            message = JointState(name=wanted["name"])
            for field in ("position", "velocity", "effort"):
                setattr(message, field, [float(one) for one in wanted.get(field, [])])
            hand.publish(stamped(message, wanted))
        if (wanted := now.get("arm")) is not None:
            pose = PoseStamped()
            for axis, one in zip("xyz", wanted["position"], strict=True):
                setattr(pose.pose.position, axis, float(one))
            for axis, one in zip("xyzw", wanted["orientation"], strict=True):
                setattr(pose.pose.orientation, axis, float(one))
            arm.publish(stamped(pose, wanted))

    node.create_timer(0.02, publish)
    say(topic="ready")
    rclpy.spin(node)


if __name__ == "__main__":
    main()
