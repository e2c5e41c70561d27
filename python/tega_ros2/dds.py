"""Join a DDS domain as ROS 2 does: its names of topics and types, type hashes, QoS and domain id."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import Any, Final, NamedTuple
from weakref import WeakValueDictionary

from tega.errors import ConfigError, DeviceUnavailableError
from tega.runtime.lifecycle import require
from tega_ros2.definitions import Definitions

_MOST_DOMAIN: Final = 232
# ROS 2's default depth, and that of its sensor data.
_DEPTH: Final = 10
_SENSOR_DEPTH: Final = 5
# How long a write may wait for a reader that does not acknowledge; the record is dropped after that.
_BLOCK_NS: Final = 1_000_000
_LOOPBACK: Final = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
_SCALARS: Final = {"string": str, "bool": bool}
_OCTETS: Final = {"byte": "uint8", "octet": "uint8", "char": "uint8"}
_domains: WeakValueDictionary[int, Any] = WeakValueDictionary()


def _sample_of(kind: Any, /, data: bytes, **_how: Any) -> Any:
    sample = kind.__new__(kind)
    sample.cdr = data
    return sample


def domain_id(environment: Mapping[str, str] = os.environ) -> int:
    """Return the number of ``ROS_DOMAIN_ID``, 0 where it is not set; no number is a :class:`ConfigError`."""
    text = environment.get("ROS_DOMAIN_ID", "") or "0"
    if not (text.isascii() and text.isdecimal() and len(text) < 4 and int(text) <= _MOST_DOMAIN):
        raise ConfigError(
            f"ROS_DOMAIN_ID = {text[:40]!r} is no domain of ROS 2", f"set a number from 0 to {_MOST_DOMAIN}"
        )
    return int(text)


def loopback_only(environment: Mapping[str, str] = os.environ) -> bool:
    """Return whether only programs of this machine are met.

    That is so unless ``ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET`` or a configuration of Cyclone DDS says otherwise: a
    run's pictures and EMG do not go to a network that nobody has named, and no stranger there moves a hand.
    """
    scope = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper()
    return scope != "SUBNET" and not environment.get("CYCLONEDDS_URI")


def dds_topic(topic: str) -> str:
    """Return the DDS name of a topic: ``/a/b`` becomes ``rt/a/b``; characters that ROS 2 lacks become ``_``."""
    parts = [re.sub(r"[^A-Za-z0-9_]", "_", part) for part in topic.strip("/").split("/")]
    return "/".join(["rt", *(f"_{part}" if part[:1].isdigit() else part for part in parts)])


class Received(NamedTuple):
    """One message that was received.

    ``sender`` is the identity of the program that published it; ``sent_ns`` is by its clock, since 1970.
    """

    cdr: bytes
    sender: str
    sent_ns: int


class DdsNode:
    """A participant of the domain, with writers and readers of ROS 2's messages."""

    def __init__(self, definitions: Definitions) -> None:
        self._definitions, self._types = definitions, dict[str, Any]()
        self._conditions: list[Any] = []
        self._senders: dict[int, str] = {}
        self._idl, self._scalars = _load("idl"), _load("idl.types")
        self._core, self._topics, self._pub, self._sub = map(_load, ("core", "topic", "pub", "sub"))
        self._qos: Any = _load("qos").Qos
        self._policy: Any = _load("qos").Policy
        self.domain_id = number = domain_id()
        domains = _load("domain")
        try:
            if loopback_only():
                # One configuration for all participants of this process, as long as there is one.
                self._domain = _domains.get(number) or domains.Domain(number, _LOOPBACK)
                _domains[number] = self._domain
            user_data = self._qos(self._policy.Userdata(data=b"enclave=/;"))
            self._participant: Any = domains.DomainParticipant(number, qos=user_data)
            self._waiting: Any = self._core.WaitSet(self._participant)
        except self._core.DDSException as error:
            raise DeviceUnavailableError(
                f"ros2: domain {number} cannot be joined: {error.msg}",
                "set another ROS_DOMAIN_ID, or look at CYCLONEDDS_URI",
            ) from error

    def close(self) -> None:
        """Leave the domain; writers and readers end with it once they are no longer referenced."""
        self._waiting = self._participant = None
        self._conditions.clear()

    def type(self, kind: str) -> Any:
        """Return the DDS type of a message such as ``sensor_msgs/msg/JointState``, whose samples are CDR bytes."""
        made = self._types.get(kind)
        if made is None:
            package, _, name = kind.partition("/msg/")
            fields = {field: self._field(of) for field, of in self._definitions.store.fielddefs[kind][1]}
            dds_name = f"{package}.msg.dds_.{name}_"
            made = self._idl.make_idl_struct(f"{name}_", dds_name, fields)
            # Samples are written and read as the CDR bytes that they are, without a second conversion.
            made.serialize = lambda sample, **_how: bytes(sample.cdr)
            made.deserialize = made.deserialize_key = classmethod(_sample_of)
            self._types[kind] = made
        return made

    def prepare(self, kind: str) -> None:
        """Build everything of a type that takes time."""
        self.type(kind).__idl__.fill_type_data()

    def writer(self, topic: str, kind: str, *, sensor: bool) -> Any:
        """Return a writer of a topic, named and typed as in ROS 2, such as ``/hand/joints``.

        If ``sensor``, its QoS is that of sensor data (best effort, depth 5); else reliable, depth 10.
        """
        qos = self._endpoint(kind, reliable=not sensor, depth=_SENSOR_DEPTH if sensor else _DEPTH)
        return self._pub.DataWriter(self._participant, self._topic(topic, kind), qos=qos)

    def reader(self, topic: str, kind: str) -> Any:
        """Return a reader of a topic, best effort: it meets every publisher, and nothing late is repeated."""
        qos = self._endpoint(kind, reliable=False, depth=_DEPTH)
        reader = self._sub.DataReader(self._participant, self._topic(topic, kind), qos=qos)
        core = self._core
        any_state = core.SampleState.Any | core.ViewState.Any | core.InstanceState.Any
        condition = core.ReadCondition(reader, any_state)
        self._waiting.attach(condition)
        self._conditions.append(condition)
        return reader

    def wait(self, timeout_s: float) -> None:
        """Wait until a reader has a message, or for some time."""
        self._waiting.wait(timeout=round(timeout_s * 1e9))

    def senders(self, reader: Any) -> set[str]:
        """Return the programs that publish what a reader reads."""
        return {self._sender(reader, handle) for handle in reader.get_matched_publications()}

    def take(self, reader: Any) -> list[Received]:
        """Return the messages that came, oldest first; of many only the newest ten."""
        found = []
        for sample in reader.take(_DEPTH):
            info = sample.sample_info
            # Of a publisher that is gone already, nothing counts any more.
            if info.valid_data and (sender := self._sender(reader, info.publication_handle)):
                found.append(Received(sample.cdr, sender, info.source_timestamp))
        return found

    def _sender(self, reader: Any, handle: int) -> str:
        found = self._senders.get(handle)
        if found is None:
            endpoint = reader.get_matched_publication_data(handle)
            if endpoint is None:  # it is gone already
                return ""
            found = self._senders[handle] = str(endpoint.participant_key)
        return found

    def write(self, writer: Any, cdr: bytes) -> bool:
        """Write a message; return false if it was dropped, because a reader does not keep up."""
        try:
            writer.write(writer.data_type.deserialize(cdr))
        except self._core.DDSException as error:
            if error.code != self._core.DDSException.DDS_RETCODE_TIMEOUT:
                raise
            return False
        return True

    def _topic(self, topic: str, kind: str) -> Any:
        return self._topics.Topic(self._participant, dds_topic(topic), self.type(kind))

    def _endpoint(self, kind: str, *, reliable: bool, depth: int) -> Any:
        policy, hashed = self._policy, self._definitions.store.hash_rihs01(kind)
        reliability = policy.Reliability
        return self._qos(
            reliability.Reliable(max_blocking_time=_BLOCK_NS) if reliable else reliability.BestEffort,
            policy.Durability.Volatile,
            policy.History.KeepLast(depth),
            policy.DataRepresentation(use_cdrv0_representation=True, use_xcdrv2_representation=False),
            policy.Userdata(data=f"typehash={hashed};".encode()),
        )

    def _field(self, of: tuple[Any, Any]) -> Any:
        """Return the type of a field from rosbags' description of it: node type, then name or element and length."""
        node, subject = of
        match node.name:
            case "BASE":
                name = subject[0]
                return _SCALARS.get(name) or getattr(self._scalars, _OCTETS.get(name, name))
            case "NAME":
                return self.type(subject)
            case "ARRAY":
                return self._scalars.array[self._field(subject[0]), subject[1]]
            case _:
                return self._scalars.sequence[self._field(subject[0])]


def _load(module: str) -> Any:
    return require(f"cyclonedds.{module}", driver="ros2", extra="ros2")
