"""Run further metrics and decoders on the pictures and samples of a run, recorded beside the connected ones.

In real time they work in threads of their own; input that they cannot keep up with is dropped and counted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tega.config import SessionConfig
from tega.config.calibration import EmgMaxima, TouchMaxima
from tega.config.choose import finger_metric, muscle_decoder
from tega.loop.inbox.inputs import Prepared
from tega.loop.inbox.sources import BlockMeter, SourceReport, chunk_of
from tega.records import BesideContact, BesideIntent, EmgSamples, Picture
from tega.records.bus import Backlog, Bus
from tega.runtime.threads import run_realtime
from tega.stages.base import Metric

# Pictures that may wait: a second of four fingers at 60 Hz would be 55 MB.
_MOST_PICTURES = 60
_MOST_CHUNKS = 4096
_MEASURED = ("in_contact", "eda", "cci", "peak", "centroid_xy", "more")
_DECODED = ("t_ns", "channels", "level", "closure", "confidence")


def open_beside(stack: ExitStack, config: SessionConfig, prepared: Prepared, bus: Bus) -> None:
    """Have the stages of ``stages.beside`` look on; ``TegaError`` where one rejects its arguments."""
    muscles = prepared.muscles
    measure_beside_on(
        stack,
        config,
        bus,
        baselines={name: finger.baseline for name, finger in prepared.fingers.items()},
        touch=prepared.calibration.touch,
        muscles=None if muscles is None else muscles.maxima,
        live=muscles is not None and muscles.source.info.live,
        real=config.session.pace == "real",
    )


def measure_beside_on(
    stack: ExitStack,
    config: SessionConfig,
    bus: Bus,
    *,
    baselines: Mapping[str, NDArray[np.uint8]],
    touch: Callable[[str], TouchMaxima | None],
    muscles: EmgMaxima | None,
    live: bool = False,
    real: bool = False,
) -> None:
    """Run stages on all frames and samples that are published on a bus, which also receives the results.

    ``touch`` gives the maxima of a finger; ``muscles`` is ``None`` without EMG. ``live`` is whether the samples come
    from a device that runs on its own clock, ``real`` whether the stages work in threads, which the stack ends.
    """
    used: dict[str, int] = {}
    for wanted in config.stages.beside:
        n = used[wanted.name] = used.get(wanted.name, 0) + 1
        stage = wanted.name if n == 1 else f"{wanted.name}-{n}"
        how: dict[str, Any] = {"name": f"beside {stage}", "vital": not real}
        if real:
            most = _MOST_PICTURES if wanted.group == "metric" else _MOST_CHUNKS
            how["backlog"] = Backlog(f"beside-{stage}", most=most, rank=run_realtime("beside"))
            stack.callback(how["backlog"].close)
        if wanted.group == "metric":
            preset = config.session.preset
            metrics = {
                name: finger_metric(wanted.stages, preset, name, baseline, touch(name))
                for name, baseline in baselines.items()
            }
            bus.subscribe(Picture, partial(_measure, stage, metrics, bus), **how)
        elif muscles is not None:
            decoder = muscle_decoder(wanted.stages, config.session.preset, muscles)
            meter = BlockMeter(decoder, SourceReport(), maxima=muscles, live=live)
            bus.subscribe(EmgSamples, partial(_decode, stage, meter, bus), **how)


def _measure(stage: str, metrics: Mapping[str, Metric], bus: Bus, picture: Picture) -> None:
    if (metric := metrics.get(picture.finger)) is not None:
        contact = metric.update(picture.image, picture.t_ns)
        found = {name: getattr(contact, name) for name in _MEASURED}
        bus.publish(BesideContact(stage=stage, finger=picture.finger, t_ns=picture.t_ns, **found))


def _decode(stage: str, meter: BlockMeter, bus: Bus, given: EmgSamples) -> None:
    for block in meter.take(chunk_of(given)):
        found = {name: getattr(block, name) for name in _DECODED}
        bus.publish(BesideIntent(stage=stage, **found))
