"""Open the sources of a run all at the same time, and make its hand ready meanwhile; none of this moves anything."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack

from tega.config import SessionConfig
from tega.devices.at_exit import closes_on_exit, release
from tega.devices.base import EmgSource, HandDriver, SteeredHand, TactileSource, WarmingHand
from tega.devices.registry import driver_class


class Opening:
    """Opens the EMG of the settings in a thread at once, since it takes the longest, the rest when asked to."""

    def __init__(self, stack: ExitStack, config: SessionConfig, *, sources: bool) -> None:
        self._stack, self._config, self._any = stack, config, sources
        self._emg: EmgSource | None = None
        self._fingers: dict[str, TactileSource] = {}
        self._opened: list[Future[None]] = []
        if sources and config.session.pace == "real":
            # In this thread: in no other can a request to terminate be caught, which has to close what they open.
            closes_on_exit(_nothing)
            stack.callback(release, _nothing)
        if sources and config.emg is not None:
            self._emg = driver_class(config.emg.driver, "emg")(config.emg.options)
            self._begin([self._emg])

    def begin_rest(self) -> HandDriver | SteeredHand | None:
        """Begin to open the sources of touch and to make the hand ready; return its driver, not open yet, if any."""
        config = self._config
        if self._any:
            for finger, c in config.tactile.items():
                self._fingers[finger] = driver_class(c.driver, "tactile")(c.options)
            self._begin(list(self._fingers.values()))
        if config.hand.driver is None:
            return None
        hand: HandDriver | SteeredHand = driver_class(config.hand.driver, "hand")(config.hand.options)
        if isinstance(hand, WarmingHand):
            self._stack.callback(hand.close)
            hand.warm_up()
        return hand

    def sources(self) -> tuple[dict[str, TactileSource], EmgSource | None]:
        """Wait until all are open; return those of touch by finger, and the EMG, whose error is raised last."""
        n_emg = self._emg is not None
        for opened in (*self._opened[n_emg:], *self._opened[:n_emg]):
            opened.result()
        return self._fingers, self._emg

    def _begin(self, sources: Sequence[EmgSource | TactileSource]) -> None:
        if not sources:
            return
        pool = ThreadPoolExecutor(max_workers=len(sources), thread_name_prefix="tega-open")
        for source in sources:
            self._stack.callback(source.close)
        self._stack.callback(pool.shutdown)
        self._opened += [pool.submit(source.open) for source in sources]
        pool.shutdown(wait=False)  # its threads end with what they open


def _nothing() -> None:
    """Do nothing: everything open closes itself."""
