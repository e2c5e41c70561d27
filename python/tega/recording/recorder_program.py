"""Run the recorder of one trial as a program: records come in by its input, and are encoded and written here.

:class:`~tega.recording.recorder_process.RecorderProcess` starts it. The program writes to its output: answers, lines
of its log, and every change of the recording's state. If its input ends without a last message, the run was killed:
the records received are written, and the file stays unfinished for the next start to recover.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from io import BufferedReader
from typing import Any

from tega.recording.mcap_folder import SessionFolder
from tega.recording.mcap_recorder import McapRecorder
from tega.runtime.child_process import AnswerPipe, program_pipes, receive_object
from tega.runtime.threads import realtime, run_realtime

# What comes without anybody waiting for an answer: the run goes on whatever becomes of it.
_UNANSWERED = {"begin", "records"}


class _LogAnswers(logging.Handler):
    def __init__(self, answers: AnswerPipe) -> None:
        super().__init__(logging.INFO)
        self._answers = answers

    def emit(self, record: logging.LogRecord) -> None:
        self._answers.say("log", record.levelno, record.name, record.getMessage())


def _serve(requested: BufferedReader, answers: AnswerPipe) -> None:
    try:
        path, settings, allowed = receive_object(requested)
    except EOFError:  # the run was killed as soon
        return
    with realtime(allowed=allowed), run_realtime("beside"):
        try:
            recorder = McapRecorder(SessionFolder(path), settings)
        except Exception as error:  # the run reports it
            answers.say("failed", error)
            return
        answers.say("done", recorder.path)
        reported = (recorder.state, recorder.reason)
        verbs: dict[str, Callable[..., Any]] = {
            "head": recorder.head,
            "begin": recorder.begin,
            "records": recorder.take,
            "finish": recorder.finish,
            "abandon": recorder.abandon,
        }
        verb = ""
        while verb not in {"finish", "abandon"}:
            try:
                verb, *content = receive_object(requested)
            except EOFError:
                recorder.leave()
                return
            try:
                answer = verbs[verb](*content)
            except Exception as error:
                if verb in _UNANSWERED:
                    answers.say("state", "stopped", f"{verb}: {type(error).__name__}: {error}")
                    recorder.leave()
                    return
                answers.say("failed", error)
                continue
            if verb not in _UNANSWERED:
                answers.say("done", answer)
            if (now := (recorder.state, recorder.reason)) != reported:
                reported = now
                answers.say("state", *now)


def main() -> None:
    """Record until the run says that it is over, or is no more."""
    requested, answers = program_pipes()
    logger = logging.getLogger("tega")
    logger.setLevel(logging.INFO)
    logger.addHandler(_LogAnswers(answers))
    logger.propagate = False
    _serve(requested, answers)


if __name__ == "__main__":
    main()
