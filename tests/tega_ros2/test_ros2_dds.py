"""Names, types, hashes and commands of ROS 2, without a network."""

from __future__ import annotations

import math
from types import SimpleNamespace as Of
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("cyclonedds", reason="needs the extra ros2")
pytest.importorskip("rosbags", reason="needs the extra ros2")

from reference.record_strategies import records_of
from reference.ros2 import in_time
from reference.sessions import tree
from tega.config import check_tree
from tega.errors import ConfigError
from tega.hand import CLOSURE_POSES_RAD, JOINT_LIMITS_RAD, JOINT_NAMES
from tega.hand.poses import ClosureScale
from tega.loop import run_session
from tega.recording.mcap_reader import Message
from tega.recording.mcap_schemas import message_class
from tega.records import RECORDS, HandExchange, Record
from tega.records.schema import own_schema, schema_name, values
from tega_ros2.convert import Converter
from tega_ros2.dds import DdsNode, dds_topic, domain_id, loopback_only
from tega_ros2.definitions import Definitions
from tega_ros2.part import age_ns, arm_pose, hand_closure
from tega_websocket.messages import MessageError

SCALE, CONVERTER = ClosureScale(), Converter("test", 0)
_own = st.one_of([records_of(kind) for kind in RECORDS if own_schema(kind) and kind is not HandExchange])
_angles = st.lists(st.floats(-math.pi, math.pi), min_size=16, max_size=16)


@pytest.fixture(scope="module")
def node() -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", "231")
        made = DdsNode(CONVERTER.definitions)
        yield made
        made.close()


# As they stand in the packages of ROS 2 Jazzy.
HASHES = {
    "sensor_msgs/msg/JointState": "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "sensor_msgs/msg/CompressedImage": "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
    "geometry_msgs/msg/WrenchStamped": "8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77",
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
}


@pytest.mark.parametrize(("kind", "hashed"), HASHES.items())
def test_hashes_of_standard_types_are_those_of_ros_s_own_packages(kind: str, hashed: str) -> None:
    assert Definitions("test").store.hash_rihs01(kind) == f"RIHS01_{hashed}"


@given(record=_own)
def test_the_announced_type_of_every_record_reads_its_message(node: Any, record: Record) -> None:
    record = in_time(record)
    name = schema_name(type(record))
    value = message_class(name)(**values(record))
    for _, kind, made in CONVERTER.convert(Message(record.where, f"tega.{name}", record.log_ns, 0, value)):
        cdr = bytes(CONVERTER.definitions.store.serialize_cdr(made, kind))
        idl = node.type(kind).__idl__
        # Cyclone DDS's own reading and writing, which nothing else here uses.
        again = idl.serialize(idl.deserialize(cdr), use_version_2=False)
        assert again == cdr


@pytest.mark.parametrize(
    ("topic", "name"),
    [
        ("/tactile/thumb/contact", "rt/tactile/thumb/contact"),
        ("/scene/cam-1/image", "rt/scene/cam_1/image"),
        ("/scene/2nd", "rt/scene/_2nd"),
    ],
)
def test_topics_are_named_as_ros_does(topic: str, name: str) -> None:
    assert dds_topic(topic) == name


@pytest.mark.parametrize("text", ["233", "-1", "1.0", "a", "²", "1" * 500])
def test_a_domain_that_is_none_is_an_error(text: str) -> None:
    with pytest.raises(ConfigError, match="ROS_DOMAIN_ID"):
        domain_id({"ROS_DOMAIN_ID": text})
    assert domain_id({}) == domain_id({"ROS_DOMAIN_ID": ""}) == 0
    assert domain_id({"ROS_DOMAIN_ID": "232"}) == 232


def test_only_this_machine_is_met_unless_it_is_said() -> None:
    assert loopback_only({})
    assert loopback_only({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})
    assert not loopback_only({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"})
    assert not loopback_only({"CYCLONEDDS_URI": "file:///etc/cyclone.xml"})


def joints(name: list[str], position: list[float], **more: list[float]) -> Any:
    return Of(name=name, position=position, **({"velocity": [], "effort": []} | more))


@pytest.mark.parametrize("level", range(1, 6))
def test_the_pose_of_a_level_asks_for_that_level_in_any_order(level: int) -> None:
    angles = CLOSURE_POSES_RAD[level - 1].tolist()
    order = np.random.default_rng(level).permutation(16)
    message = joints([JOINT_NAMES[i] for i in order], [angles[i] for i in order])
    assert hand_closure(message, SCALE) == pytest.approx((level - 1) / 4)


@given(angles=_angles)
def test_a_target_beyond_the_limits_is_that_at_the_limits(angles: list[float]) -> None:
    inside = np.clip(angles, JOINT_LIMITS_RAD[:, 0], JOINT_LIMITS_RAD[:, 1]).tolist()
    closure = hand_closure(joints(list(JOINT_NAMES), angles), SCALE)
    assert closure == hand_closure(joints(list(JOINT_NAMES), inside), SCALE)
    assert 0 <= closure <= 1


@given(closure=st.floats(-0.1, 1.1))
def test_a_closure_is_kept_between_open_and_closed(closure: float) -> None:
    assert hand_closure(joints(["closure"], [closure]), SCALE) == min(max(closure, 0.0), 1.0)


@given(
    name=st.lists(st.sampled_from([*JOINT_NAMES, "closure", "x"]), max_size=17),
    position=st.lists(st.floats(width=64), max_size=17),
)
def test_any_joint_state_is_a_closure_or_refused(name: list[str], position: list[float]) -> None:
    try:
        closure = hand_closure(joints(name, position), SCALE)
    except MessageError:
        return
    assert 0 <= closure <= 1


@given(place=st.tuples(*[st.floats()] * 3), turn=st.tuples(*[st.floats()] * 4))
def test_any_pose_is_finite_and_a_rotation_or_refused(place: Any, turn: Any) -> None:
    position, orientation = (
        Of(**dict(zip("xyz", place, strict=True))),
        Of(**dict(zip("xyzw", turn, strict=True))),
    )
    try:
        found = arm_pose(Of(pose=Of(position=position, orientation=orientation)))
    except MessageError:
        return
    assert all(map(math.isfinite, found[0]))
    assert math.hypot(*found[1]) == pytest.approx(1.0, abs=1e-3)


def test_the_age_is_that_of_the_header_or_of_the_publication() -> None:
    def age(stamp_ns: int, sent_ns: int = 0) -> int:
        stamp = Of(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        return age_ns(Of(header=Of(stamp=stamp)), sent_ns=sent_ns, now_ns=5 * 10**9)

    assert age(4 * 10**9) == 10**9
    assert age(0, sent_ns=3 * 10**9) == 2 * 10**9
    assert age(5 * 10**9 + 10**6) == 0  # a clock a little ahead
    with pytest.raises(MessageError, match="ahead: its time is 1 s ahead"):
        age(6 * 10**9)


@pytest.mark.parametrize(
    ("table", "more", "sentence"),
    [
        ({"hand": "hand target"}, {}, "ros2.hand"),
        ({"hand": "/2nd"}, {}, "ros2.hand"),
        ({"hand": "/target"}, {}, r"ros2.hand and \[emg\] both lead the hand"),
        ({"arm": "/forearm"}, {}, r"there is no \[arm\]"),
        ({"hand": "/target"}, {"emg": None, "websocket": {"hand": True, "port": 0}}, "both lead the hand"),
        ({"hand": "/target"}, {"emg": None, "session": {"pace": "fast"}}, "need real time"),
    ],
)
def test_settings_that_do_not_fit_are_refused(
    table: dict[str, Any], more: dict[str, Any], sentence: str, tmp_path: Any
) -> None:
    given = tree(tmp_path) | {"session": {"pace": "real"}} | {"ros2": table} | more
    given = {key: one for key, one in given.items() if one is not None}
    with pytest.raises(ConfigError, match=sentence):
        run_session(check_tree(given, {}, base=tmp_path).config)
