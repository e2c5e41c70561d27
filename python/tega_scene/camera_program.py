"""Film with one scene camera as a program of its own, so that encoding never holds the run's interpreter lock.

:class:`~tega_scene.part.ScenePart` starts it. It writes packets, small frames for the page and counts to its
output. At the end of its input it encodes the remaining frames, writes its counts, and ends.
"""

from __future__ import annotations

import os
from contextlib import suppress

from tega.runtime.child_process import program_pipes, receive_object
from tega.runtime.clock import every
from tega_scene.filming import Filming

_REPORTED_S = 0.25
# Where the run has no real-time priority it goes first so.
_NICE = 5


def main() -> None:
    """Film from the run's word on until its input ends."""
    requested, answers = program_pipes()
    try:
        camera, shows, gives_way = receive_object(requested)
    except EOFError:  # the run was killed as soon
        return
    if gives_way and hasattr(os, "nice"):
        os.nice(_NICE)
    try:
        film = Filming(
            camera,
            give=lambda packets: answers.say("video", packets) if packets else None,
            show=(lambda t_ns, image: answers.say("shown", t_ns, image)) if shows else None,
            reopens=True,
        )
        film.open()
    except Exception as error:  # the run reports it
        answers.say("failed", error)
        return
    answers.say("open")
    film.start()
    with every(lambda: answers.say("tally", film.tally), every_s=_REPORTED_S):
        with suppress(EOFError):
            film.begin(receive_object(requested))
            receive_object(requested)  # nothing more is asked: this waits for the end
        film.leave()
    answers.say("tally", film.tally)


if __name__ == "__main__":
    main()
