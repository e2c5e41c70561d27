"""Let features play their own topics of a recording."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

from tega.errors import ConfigError
from tega.runtime.features import targets

if TYPE_CHECKING:
    from tega.recording.mcap_reader import Message
    from tega.recording.replay.followed_file import FollowedFile, StreamFollower
    from tega.records.bus import Bus


class PlayedTopics(NamedTuple):
    """Topics of a recording that a feature plays.

    Attributes:
        followers: Follower of each topic.
        delays_ns: Delay of a topic's data, by topic, nanoseconds; 0 unless given.
    """

    followers: Mapping[str, StreamFollower]
    delays_ns: Mapping[str, int]


class Player(Protocol):
    """Plays the topics of one feature; made for each recording that is read."""

    def note(self, message: Message) -> None:
        """Note a message of the recording's first pass that is none of TEGA's own."""
        ...

    def topics(self, path: Path, zero_ns: int, bus: Bus) -> PlayedTopics:
        """Return the topics to play; none where no subscriber wants them.

        Args:
            path: The recording.
            zero_ns: Log time at the beginning of the recording.
            bus: Bus on which followers publish.
        """
        ...

    def beside(
        self, path: Path, bus: Bus, *, start_ns: int, end_ns: int, behind_ns: int
    ) -> FollowedFile | None:
        """Return another file of the same time, to be played beside the recording; ``None`` if it is not wanted.

        Args:
            path: The file.
            bus: Bus on which followers publish.
            start_ns: Machine's clock at the beginning of the recording.
            end_ns: Length of the recording.
            behind_ns: See :class:`~tega.recording.replay.followed_file.FollowedFile`.
        """
        ...


def players() -> list[Player]:
    """Return a new player of every feature that plays topics of its own."""
    return [player() for _, player in targets("played")]


def refuse_namesakes(followers: Iterable[StreamFollower]) -> None:
    """Refuse two streams of one name.

    Raises:
        ConfigError: There are two.
    """
    names = [one.name for one in followers]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"two streams to be played are called {name!r}", "leave one of them out")
