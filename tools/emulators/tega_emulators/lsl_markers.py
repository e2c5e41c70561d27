"""Another program that marks moments and receives those of others: ``python -m tega_emulators.lsl_markers``.

Needs ``pylsl``. What its stream is called is the ``port`` that it prints. Commands: ``mark TEXT`` marks now,
``mark TEXT S`` what was S seconds ago; ``mark-latin TEXT`` marks TEXT and an accent in Latin-1; ``hear NAME`` listens
to a stream of texts; ``heard`` returns what came, each with its stamp as it was sent. ``at_s`` is this process's
monotonic clock, seconds; on Linux that is the library's own.
"""

from __future__ import annotations

import argparse
import os
import sys
from typing import Any

from tega_emulators.pipe import notify, obey

__all__ = ["main"]

_FIND_S = 10.0


def main() -> None:
    """Obey until the standard input closes or says ``quit``."""
    import pylsl

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--name", default=f"marks-{os.getpid()}")
    name = parser.parse_args().name
    outlet = pylsl.StreamOutlet(
        pylsl.StreamInfo(name, "Markers", 1, 0.0, "string", f"emulator-{os.getpid()}")
    )
    inlets: list[Any] = []
    received: list[tuple[float, str]] = []
    notify({"port": name})

    def act(words: list[str]) -> dict[str, Any] | None:
        if words[0] in {"mark", "mark-latin"}:
            at_s = pylsl.local_clock() - (float(words[2]) if len(words) > 2 else 0.0)
            outlet.push_sample([words[1].encode() + (b"" if words[0] == "mark" else b"\xe9")], at_s)
            return {"at_s": at_s, "consumers": outlet.have_consumers()}
        if words[0] == "hear":
            (stream, *_) = pylsl.resolve_byprop("name", words[1], 1, _FIND_S) or [None]
            if stream is None:
                return {"found": False}
            inlet = pylsl.StreamInlet(stream)
            inlet.open_stream(_FIND_S)
            inlets.append(inlet)
            return {"found": True, "xml": inlet.info().as_xml()}
        if words[0] == "heard":
            for inlet in inlets:
                while (got := inlet.pull_sample(0.0))[0] is not None:
                    received.append((got[1], got[0][0]))
            return {"heard": received}
        raise ValueError(words[0])

    for line in sys.stdin:
        if line.split() in ([], ["quit"]):
            return
        obey(line, act)


if __name__ == "__main__":
    main()
