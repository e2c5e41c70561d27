"""Two stations that are kept for the next fault which needs the same ones."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from tega.errors import TegaError
from tega_campaigns.lossy_wire import LossyWire
from tega_campaigns.station_faults.scene import SECOND, StationScene
from tega_link.keys import make_keys

__all__ = ["Setups"]


class Setups:
    """Starts stations, and takes those that are there where they fit; ends with the block.

    Starting two stations and their devices takes longer than most faults do.
    """

    def __init__(self) -> None:
        self._stack = ExitStack()
        self._scene: StationScene | None = None
        self._setup: tuple[Mapping[str, Any], bool, bool] | None = None

    def __enter__(self) -> Self:
        """Nothing is started yet."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End what is there."""
        self.drop()

    def drop(self) -> None:
        """End what is there, so that the next fault gets stations of its own."""
        self._scene = self._setup = None
        self._stack.close()

    def scene(self, *, net: Mapping[str, Any], keys: bool, wire: bool) -> StationScene:
        """Return stations of a setup whose operator steers hand and arm.

        Args:
            net: Further settings of ``[net]``, for both stations.
            keys: Whether the link is encrypted.
            wire: Whether packets pass a wire, instead of bytes a proxy.

        Raises:
            DeviceUnavailableError: They do not come together.
        """
        setup = (net, keys, wire)
        if self._scene is not None and self._setup == setup:
            try:
                self._scene.take_hold()
            except TegaError:  # what the fault before has left cannot be used
                pass
            else:
                return self._scene
        self.drop()
        stack = self._stack
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="tega-stations-")))
        between = stack.enter_context(LossyWire()) if wire else None
        if keys:
            make_keys(folder / "keys", operators=["operator", SECOND], robots=["robot"])
        scene = StationScene(folder, net=dict(net), keys=folder / "keys" if keys else None, wire=between)
        self._scene, self._setup = stack.enter_context(scene), setup
        return self._scene
