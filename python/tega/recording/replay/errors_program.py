"""Measure the compressed pictures of a recording in a process of its own, while its loop is run again in another.

The loop takes the contacts as they were recorded, so that neither process needs anything of the other.
"""

from __future__ import annotations

import io
import os
import subprocess
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from tega.errors import RecordingError
from tega.recording.replay.feed import RecordFeed
from tega.recording.replay.head import with_changes
from tega.recording.replay.measured import Measured, PictureError
from tega.records import Contact
from tega.records.bus import Bus
from tega.runtime.child_process import end_child, start_child
from tega.runtime.object_pipe import program_pipes, receive_object, send_object


def picture_errors(path: Path, config: Path | None, sets: Sequence[str]) -> list[PictureError]:
    """Return the errors of contacts measured in a recording's compressed pictures, by finger.

    Args:
        path: The recording.
        config: Other settings to measure with, as for :func:`~tega.recording.replay.replay_file`.
        sets: Single settings.

    Raises:
        RecordingError: The recording cannot be read.
        ConfigError: The other settings cannot be used.
    """
    feed = RecordFeed(path)
    head = with_changes(feed.head, config, sets)
    feed.head = replace(head, sources={finger: head.sources[finger] for finger in head.baselines})
    measured = Measured(feed, Bus())
    feed.bus.subscribe(Contact, measured.contact, vital=True)
    feed.read_rest()
    return list(measured.errors.values())


@contextmanager
def errors_beside(*asked: Any) -> Iterator[Callable[[], list[PictureError]]]:
    """Start to measure with the arguments of :func:`picture_errors`; return a function that waits for the errors.

    Raises:
        TegaError: By that function, as :func:`picture_errors` raises it.
    """
    child = start_child(__name__, stdout=subprocess.PIPE)
    assert isinstance(child.stdin, io.BufferedWriter)
    assert isinstance(child.stdout, io.BufferedReader)
    pipe = child.stdout

    def wait() -> list[PictureError]:
        try:
            verb, found = receive_object(pipe)
        except EOFError:
            raise RecordingError(
                "the program that measures pictures ended", "run it again; is memory short?"
            ) from None
        if verb == "failed":
            raise found
        errors: list[PictureError] = found
        return errors

    try:
        send_object(child.stdin, asked)
        yield wait
    finally:
        end_child(child, 0.0)
        pipe.close()


def _end_with(requested: io.BufferedReader) -> None:
    """End with the program that asked."""
    requested.read()
    os._exit(1)


def main() -> None:
    """Measure, and send the errors."""
    requested, answers = program_pipes()
    asked = receive_object(requested)
    threading.Thread(target=_end_with, args=(requested,), daemon=True).start()
    try:
        answers.say("done", picture_errors(*asked))
    except Exception as error:  # the replay raises it
        answers.say("failed", error)


if __name__ == "__main__":
    main()
