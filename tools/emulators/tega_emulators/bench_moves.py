"""Move the emulated bench: muscles squeeze, fingertips are pressed, and the hand closes on a thing that it then feels.

Moves come as lines: typed, from a seeded script, or over a local TCP port, whose number :class:`Moves` gives.
"""

from __future__ import annotations

import json
import random
import socketserver
import threading
from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any, Final, Self

import numpy as np

from tega.config import FINGERS
from tega.errors import InvalidValueError, TegaError
from tega.hand.poses import ClosureScale
from tega.runtime.clock import every
from tega_emulators.process import Emulator
from tega_emulators.vest_bench import seen_by

__all__ = ["MOVES", "Moves"]

MOVES: Final = (
    "rest, squeeze [STRENGTH [CHANNEL]], press FINGER [FIRMNESS [round|flat]], release, put round|flat, take, "
    "play [SEED], stop"
)
"""What :meth:`Moves.act` understands; ``vest`` besides, which returns what the vest's motors did."""

# What an arm that lies still has of full effort.
_REST: Final = 0.02
_CHANNELS: Final = 8  # of a Cyton
_FIRM: Final = 0.7
_SHAPES: Final = ("round", "flat")
# Levels from 1 to 5 at which a closing hand begins to feel the thing in it, and holds it as firmly as it can.
_TOUCHES_AT, _FIRMEST_AT = 2.0, 5.0
_POLL_S: Final = 0.1
# A sensor makes the pictures of each firmness when it is asked for the first time, so there are few.
_STEPS: Final = 8


class Moves:
    """Moves the emulated devices for as long as the ``with`` block lasts.

    In the hand there is a thing, at first a round one: while the hand's motors are on, its closure presses
    the fingertips. ``digits`` are thumb first. ``port`` is the TCP port on 127.0.0.1 that takes moves, one a
    line, and answers each with a line of JSON.
    """

    def __init__(self, digits: list[Emulator], board: Emulator, player: Emulator, hand: Emulator) -> None:
        self._sensors = dict(zip(FINGERS, digits, strict=False))
        self._board, self._player, self._hand = board, player, hand
        self._closure = ClosureScale()
        self._thing = "round"
        self._held = 0.0
        self._script: threading.Event | None = None
        self._up = ExitStack()
        self.port = 0

    def __enter__(self) -> Self:
        """Begin to listen, and to let the hand feel what it holds."""
        with ExitStack() as starting:
            server = starting.enter_context(_server(self.act))
            self.port = server.server_address[1]
            threading.Thread(target=server.serve_forever, name="tega-moves", daemon=True).start()
            starting.callback(server.shutdown)
            starting.enter_context(every(self._hold, every_s=_POLL_S))
            self._up = starting.pop_all()
        return self

    def __exit__(self, *_error: object) -> None:
        """Stop moving."""
        self._stop_script()
        self._up.close()

    def act(self, line: str) -> Mapping[str, Any]:
        """Carry out a move. One that a person makes ends the script.

        ``line`` is ``rest``; ``squeeze`` with a strength from 0 to 1 (1) and a channel from 1 to 8 (all);
        ``press`` with a finger, a firmness from 0 to 1 (0.7) and what with (round); ``release`` of all
        fingers; ``put`` a round or flat thing into the hand, ``take`` it away; ``play`` a script of a seed
        (0), ``stop`` it. Returns nothing, or for ``vest`` the history of its motors. Any other line raises
        :class:`InvalidValueError`.
        """
        words = line.split()
        if words == ["vest"]:
            return {"history": seen_by(self._player).history}
        try:
            self._stop_script()
            self._move(*words)
        except (KeyError, TypeError, ValueError):
            raise InvalidValueError(
                f"{line!r} is no move of the emulated bench", f"type one of: {MOVES}"
            ) from None
        return {}

    def play(self, seed: int) -> None:
        """Squeeze, rest and press by a script of a seed, until a move is made."""
        self._stop_script()
        over = self._script = threading.Event()
        threading.Thread(target=self._play, args=(random.Random(seed), over), name="tega-script").start()

    def _move(self, verb: str, *rest: str) -> None:
        if verb == "rest" and not rest:
            self._board.say(f"effort {_REST}")
        elif verb == "squeeze":
            self._squeeze(*rest)
        elif verb == "press":
            self._press(*rest)
        elif verb == "release" and not rest:
            for sensor in self._sensors.values():
                sensor.say("press 0")
        elif verb == "put" and len(rest) == 1 and rest[0] in _SHAPES:
            self._thing = rest[0]
        elif verb == "take" and not rest:
            self._thing = ""
        elif verb == "play" and len(rest) <= 1:
            self.play(int(rest[0]) if rest else 0)
        elif verb != "stop" or rest:
            raise ValueError(verb)

    def _squeeze(self, strength: str = "1", channel: str = "") -> None:
        effort = f"effort {max(_share(strength), _REST)}"
        if channel:
            if not 1 <= int(channel) <= _CHANNELS:
                raise ValueError(channel)
            self._board.say(f"effort {_REST}")
            effort += f" {int(channel)}"
        self._board.say(effort)

    def _press(self, finger: str, firmness: str = str(_FIRM), shape: str = "round") -> None:
        if shape not in _SHAPES:
            raise ValueError(shape)
        self._sensors[finger].say(f"press {_share(firmness)} {shape}")

    def _hold(self) -> None:
        """Press the fingertips as firmly as the hand has closed on what is in it."""
        state = self._hand.say("look")
        closure = self._closure(np.array(state["angles_rad"])) if state["servo_on"] and self._thing else 0.0
        share = min(1.0, max(0.0, (closure - _TOUCHES_AT) / (_FIRMEST_AT - _TOUCHES_AT)))
        held = round(share * _STEPS) / _STEPS
        if held != self._held:
            self._held = held
            for sensor in self._sensors.values():
                sensor.say(f"press {held} {self._thing or 'round'}")

    def _play(self, chance: random.Random, over: threading.Event) -> None:
        while not over.is_set():
            finger = chance.choice(list(self._sensors))
            for line in (
                f"squeeze {chance.uniform(0.2, 0.9):.2f}",
                f"press {finger} {chance.uniform(0.4, 1.0):.2f} {chance.choice(_SHAPES)}",
            ):
                self._move(*line.split())
            over.wait(chance.uniform(1.5, 4.0))
            self._move("release")
            self._move("rest")
            over.wait(chance.uniform(1.0, 3.0))

    def _stop_script(self) -> None:
        if self._script is not None:
            self._script.set()
            self._script = None


def _server(act: Any) -> socketserver.ThreadingTCPServer:
    class Line(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            for raw in self.rfile:
                try:
                    sentence = dict(act(raw.decode("utf-8", "replace").strip()))
                except TegaError as error:
                    sentence = {"error": error.message}
                self.wfile.write(json.dumps(sentence).encode() + b"\n")

    server = socketserver.ThreadingTCPServer(("127.0.0.1", 0), Line)
    server.daemon_threads = True
    return server


def _share(text: str) -> float:
    share = float(text)
    if not 0 <= share <= 1:
        raise ValueError(text)
    return share
