"""Define the records of the muscles: EMG samples, and the intents decoded from them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar

import msgspec

from tega.records.base import Ns, Record, Share, Step, quantity

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class EmgSamples(Record, frozen=True, kw_only=True):
    """Consecutive EMG samples, as they were read.

    Attributes:
        t_ns: When the last of them was complete, since the start of the session.
        received_ns: When the program had them; ``t_ns`` for those out of a file.
        first_index: Number of the first of them; a gap is a loss.
        n_channels: How many channels.
        samples: float64 (n · channels,), sample by sample, in the source's unit.
    """

    topic: ClassVar[str] = "/emg/samples"

    t_ns: Ns
    received_ns: Ns
    first_index: int
    n_channels: Step
    samples: Annotated[NDArray[np.float64], quantity("the source's", "double*")]

    @property
    def log_ns(self) -> int:
        """Time at which the program had the samples."""
        return self.received_ns

    @property
    def n_bytes(self) -> int:
        """Memory of the samples, bytes."""
        return self.samples.nbytes


class Intent(Record, frozen=True, kw_only=True):
    """Intent of the operator: the level or closure that the muscles ask of the hand.

    Attributes:
        t_ns: When the block of samples was complete, since the start of the session.
        taken_ns: The loop's tick at which it was taken in.
        channels: Level of each muscle, 0 to 5; 0 for one that cannot be believed.
        level: Closure level of all of them together, 1 to 5.
        closure: From 0 (open) to 1 (closed); ``None`` where the decoder knows levels only.
        confidence: How sure the decoder is, 0 to 1; ``None`` where it does not say.
        activity: Of each muscle, as a share of its maximum; empty where the decoder does not say.
    """

    topic: ClassVar[str] = "/emg/levels"
    schema: ClassVar[str] = "Levels"
    version: ClassVar[int] = 2
    table: ClassVar[tuple[str, ...]] = ("t_s", "channels", "level")

    t_ns: Ns
    taken_ns: Ns = 0
    channels: tuple[Step, ...] = ()
    level: Step = msgspec.field(default=1, name="fused")
    closure: Share | None = None
    confidence: Share | None = None
    activity: tuple[Share, ...] = ()

    @property
    def log_ns(self) -> int:
        """Time at which the loop took the intent in."""
        return self.taken_ns
