"""Call a function in a process of its own, while this program goes on with what does not need the result."""

from __future__ import annotations

import gc
import io
import os
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from tega.runtime.child_process import end_child, program_pipes, receive_object, send_object, start_child

Result = TypeVar("Result")


@contextmanager
def called_beside(
    function: Callable[..., Result], *arguments: Any, lost: Exception
) -> Iterator[Callable[[], Result]]:
    """Begin a call of a module's function in a process; yield a function that waits for its result.

    Arguments and result have to be known to :mod:`pickle`. The waiting function raises what the call raised,
    or ``lost`` where the process ends without a result, as when memory is short. The process ends with the
    block, and with this program.
    """
    child = start_child(__name__, stdout=subprocess.PIPE)
    assert isinstance(child.stdin, io.BufferedWriter)
    assert isinstance(child.stdout, io.BufferedReader)
    pipe = child.stdout

    def wait() -> Result:
        try:
            verb, found = receive_object(pipe)
        except EOFError:
            raise lost from None
        if verb == "failed":
            raise found
        result: Result = found
        return result

    try:
        send_object(child.stdin, (function, arguments))
        yield wait
    finally:
        end_child(child, 0.0)
        pipe.close()


def _end_with(requested: io.BufferedReader) -> None:
    """End with the program that asked."""
    requested.read()
    os._exit(1)


def main() -> None:
    """Call the function that is asked for, and send its result."""
    requested, answers = program_pipes()
    function, arguments = receive_object(requested)
    threading.Thread(target=_end_with, args=(requested,), daemon=True).start()
    gc.freeze()  # modules and types stay: the collector need not look at them again
    try:
        answers.say("done", function(*arguments))
    except Exception as error:  # who asked raises it
        answers.say("failed", error)


if __name__ == "__main__":
    main()
