"""Put each picture of a recording together with its numbers and times, which are a message of their own behind it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from tega.recording.mcap_reader import Message

PICTURES: Final = frozenset({"foxglove.RawImage", "foxglove.CompressedImage"})
"""Schemas of images."""


def paired(messages: Iterable[Message]) -> Iterator[Message]:
    """Yield the messages of a recording but images: those are in the messages of their numbers and times."""
    images: dict[str, Message] = {}
    for message in messages:
        if message.schema in PICTURES:
            if message.value is not None:
                images[message.topic] = message
        elif message.schema == "tega.Frame":
            yield message._replace(image=images.pop(f"{message.topic.removesuffix('/frame')}/image", None))
        else:
            yield message
