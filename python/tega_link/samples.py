"""Send the operator's EMG for the robot's recording: behind all commands, left out where the link is slow."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tega.devices.base import EmgChunk
from tega.records import EmgSamples
from tega_link.clock import Offset
from tega_link.ends import FarMuscles
from tega_link.gate import StampGate
from tega_link.messages import Samples, encode

_AT_ONCE_NS = 50_000_000
_NEVER_OLD_NS = 10**12


class SampleSender:
    """Sends the amplifier's samples, about twenty times a second, while the robot's station records."""

    def __init__(self, stamp: Callable[[], dict[str, Any]], wanted: Callable[[], bool]) -> None:
        self._stamp, self._wanted = stamp, wanted
        self._send: Callable[[bytes], None] = lambda _message: None
        self._start_ns: int | None = None
        self._waiting: list[EmgSamples] = []

    def open(self, send: Callable[[bytes], None]) -> None:
        """Take note of what sends."""
        self._send = send

    def begin(self, start_ns: int) -> None:
        """Send from now on; samples are stamped from this start."""
        self._start_ns = start_ns

    def take(self, chunk: EmgSamples) -> None:
        """Take a chunk, in the thread that reads the amplifier."""
        start_ns = self._start_ns
        if start_ns is None or not self._wanted():
            self._waiting.clear()
            return
        before = self._waiting[-1] if self._waiting else chunk
        if (
            before is not chunk
            and chunk.first_index != before.first_index + len(before.samples) // before.n_channels
        ):
            self._pass_on(start_ns)  # samples are missing between, so that they have to be two messages
        self._waiting.append(chunk)
        if chunk.t_ns - self._waiting[0].t_ns >= _AT_ONCE_NS:
            self._pass_on(start_ns)

    def _pass_on(self, start_ns: int) -> None:
        waiting, self._waiting = self._waiting, []
        samples = np.concatenate([chunk.samples for chunk in waiting]).astype("<f8")
        message = Samples(
            **self._stamp(),
            t_ns=waiting[-1].t_ns + start_ns,
            first_index=waiting[0].first_index,
            n_channels=waiting[0].n_channels,
            samples=samples.tobytes(),
        )
        self._send(encode(message))


class SampleReceiver:
    """Takes in the EMG samples that come over the link."""

    def __init__(self, muscles: FarMuscles) -> None:
        self._muscles = muscles
        self._gate = StampGate(ttl_ns=_NEVER_OLD_NS)

    def begin(self, session: int | None) -> None:
        """Listen to a session from its beginning; to none with ``None``."""
        self._gate.begin(session)

    def take(self, data: bytes, now_ns: int, offset: Offset | None) -> None:
        """Take in a message of the leader's."""
        batch = self._gate.read(Samples, data)
        if batch is None or self._gate.refusal(batch, now_ns, offset) or offset is None:
            return
        samples = np.frombuffer(batch.samples, "<f8").reshape(-1, batch.n_channels).astype(np.float64)
        self._muscles.give(EmgChunk(min(offset.ours(batch.t_ns), now_ns), batch.first_index, samples))
