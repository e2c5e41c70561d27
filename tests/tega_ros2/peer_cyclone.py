# mypy: ignore-errors
# Types of Cyclone DDS are checked by a plug-in of its own alone.
"""The peer of :mod:`peer_rclpy` by Cyclone DDS, with types written by hand from ROS 2's own ``.msg`` files.

Contacts are received with the type that TEGA announces, which Cyclone DDS asks for on the wire.
"""

import time
from typing import Any

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import DDSException, Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.dynamic import get_types_for_typeid
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl.types import float64, int32, sequence, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from peer_lines import asked, fields_of, say


def message(kind: str, **fields: Any) -> Any:
    package, _, name = kind.partition("/")
    return make_idl_struct(name, f"{package}.msg.dds_.{name}_", fields)


Time = message("builtin_interfaces/Time", sec=int32, nanosec=uint32)
Header = message("std_msgs/Header", stamp=Time, frame_id=str)
String = message("std_msgs/String", data=str)
JointState = message(
    "sensor_msgs/JointState",
    header=Header,
    name=sequence[str],
    **dict.fromkeys(("position", "velocity", "effort"), sequence[float64]),
)
CompressedImage = message("sensor_msgs/CompressedImage", header=Header, format=str, data=sequence[uint8])
Vector3 = message("geometry_msgs/Vector3", x=float64, y=float64, z=float64)
Wrench = message("geometry_msgs/Wrench", force=Vector3, torque=Vector3)
WrenchStamped = message("geometry_msgs/WrenchStamped", header=Header, wrench=Wrench)
Point = message("geometry_msgs/Point", x=float64, y=float64, z=float64)
Quaternion = message("geometry_msgs/Quaternion", x=float64, y=float64, z=float64, w=float64)
Pose = message("geometry_msgs/Pose", position=Point, orientation=Quaternion)
PoseStamped = message("geometry_msgs/PoseStamped", header=Header, pose=Pose)

RELIABLE = Qos(Policy.Reliability.Reliable(max_blocking_time=10**8), Policy.History.KeepLast(10))
BEST_EFFORT = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(5))
HEARD = {
    "/hand/joints": (JointState, RELIABLE),
    "/tactile/thumb/image": (CompressedImage, BEST_EFFORT),
    "/tactile/thumb/wrench": (WrenchStamped, RELIABLE),
    "/run/state/text": (String, RELIABLE),
}
CONTACT = "/tactile/thumb/contact"


class Peer:
    """The participant, its readers and writers."""

    def __init__(self) -> None:
        from tega_ros2.dds import DdsNode  # for the domain on the loopback interface alone
        from tega_ros2.definitions import Definitions

        self._node = DdsNode(Definitions("peer"))
        self.participant: DomainParticipant = self._node._participant
        self.readers = {
            topic: DataReader(self.participant, Topic(self.participant, f"rt{topic}", kind), qos=qos)
            for topic, (kind, qos) in HEARD.items()
        }
        self._publications = BuiltinDataReader(self.participant, BuiltinTopicDcpsPublication)
        self.hand = self._writer("rt/hand/target", JointState)
        self.arm = self._writer("rt/forearm", PoseStamped)
        self.seen: dict[str, Any] = {}

    def _writer(self, name: str, kind: Any) -> Any:
        return DataWriter(self.participant, Topic(self.participant, name, kind), qos=RELIABLE)

    def check(self) -> None:
        """Note the publishers, and subscribe to contacts once somebody announces their type."""
        for one in self._publications.read(200):
            if getattr(one, "topic_name", None) is None or one.participant_key == self.participant.guid:
                continue
            topic = one.topic_name.removeprefix("rt")
            user = one.qos[Policy.Userdata] if Policy.Userdata in one.qos else None  # noqa: SIM401
            reliability = one.qos[Policy.Reliability]
            kind = "BEST_EFFORT" if reliability == Policy.Reliability.BestEffort else "RELIABLE"
            text = "" if user is None else user.data.decode()
            self.seen[topic] = [one.type_name, text, kind]
            if topic == CONTACT and topic not in self.readers and one.type_id is not None:
                try:
                    found, _ = get_types_for_typeid(self.participant, one.type_id, 10**9)
                except DDSException:
                    continue
                made = Topic(self.participant, f"rt{CONTACT}", found)
                self.readers[topic] = DataReader(self.participant, made, qos=RELIABLE)


def header(wanted: dict[str, Any]) -> Header:
    if not wanted.get("stamp", True):
        return Header(Time(0, 0), "")
    t_ns = time.time_ns() + round(1e9 * wanted.get("ahead_s", 0.0))
    return Header(Time(*divmod(t_ns, 10**9)), "")


def main() -> None:
    requested, peer, now, n = asked(), Peer(), dict[str, Any](), 0
    say(topic="ready")
    while True:
        time.sleep(0.02)
        n += 1
        while not requested.empty():
            now.update(requested.get())
            if "graph" in now:
                say(graph={"publishers": peer.seen}, topic=now.pop("graph"))
        if n % 10 == 0:
            peer.check()
        for topic, reader in peer.readers.items():
            for taken in reader.take(10):
                if taken.sample_info.valid_data:
                    say(topic=topic, **fields_of(taken))
        if (wanted := now.get("hand")) is not None:
            more: Any = [
                [float(one) for one in wanted.get(f, [])] for f in ("position", "velocity", "effort")
            ]
            peer.hand.write(JointState(header(wanted), wanted["name"], *more))
        if (wanted := now.get("arm")) is not None:
            place = Point(*map(float, wanted["position"]))
            turn = Quaternion(*map(float, wanted["orientation"]))
            peer.arm.write(PoseStamped(header(wanted), Pose(place, turn)))


if __name__ == "__main__":
    main()
