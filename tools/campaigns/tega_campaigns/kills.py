"""Kills recordings at random instants and looks at what is left.

``python -m tega_campaigns.kills --instants 20 --seed 1`` starts a lossless recording in real time as often, kills its
process (SIGKILL) at a random instant, opens the file with the public ``mcap`` reader, finishes it as the next run
would, opens that too, and computes it again. What is lost is counted in the finished file. Exit code 1 unless every
one is good; ``--markdown docs/evidence/recording.md`` writes the table of the docs.

The run is fed by the emulated DIGIT, Cyton and Allegro Hand in processes of their own, and feels an emulated Player.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from tega.recording.mcap_folder import SessionFolder
from tega.recording.mcap_reader import McapReader
from tega.recording.replay import replay_file
from tega.runtime.files.toml_text import tree_text
from tega_campaigns.program import noted_tick_ns
from tega_campaigns.runner import CampaignCase, put_table, report_cases, table, until
from tega_campaigns.supervisor import Supervisor
from tega_emulators.lab import emulated_lab

__all__ = ["Kill", "kill_one", "kill_table", "main", "settings"]

MOST_LOST_S = 0.5
"""What a kill may cost."""

_BEGIN_S = 60.0
_LONGEST_S = 4.0
_DISPLAYED = 5
"""Kills in the table of the docs: those that cost most."""


class Kill(msgspec.Struct, frozen=True):
    """What one kill left.

    Attributes:
        at_s: When it came, after the session began.
        messages: What the public reader found in the file as it was left.
        ending: What that reader reported where the file breaks off.
        lost_s: Of what the loop had done: from its newest frame in the finished file to the newest vest tick
            that the run had come to, as it noted in memory that outlives it.
        stood_s: From that tick to the kill; more than a tick or two: the machine did not let it run.
        stream_lost_s: Like ``lost_s``, of the stream that lost most, of those that came at least ten times.
        recovered: Messages in the file once it was finished, by the public seeking reader.
        dropped: Records that the queue had no room for.
        differ: Rows in which a replay differs.
        good: Whether all is as promised.
    """

    at_s: float
    messages: int
    ending: str
    lost_s: float
    stood_s: float
    stream_lost_s: float
    recovered: int
    dropped: int
    differ: int
    good: bool


@contextmanager
def settings(folder: Path, *, synthetic: bool, lossless: bool) -> Iterator[Path]:
    """Write the settings of a run that lasts, start what it needs, and yield their file.

    ``synthetic`` takes made-up sources instead of emulators; ``lossless`` records the pictures as they are.
    """
    fingers = ("thumb", "index")
    with ExitStack() as stack:
        if synthetic:
            tree: dict[str, Any] = {
                "session": {"pace": "real"},
                "tactile": {
                    finger: {"driver": "synthetic-touch", "options": {"duration_s": 8.0, "seed": k}}
                    for k, finger in enumerate(fingers)
                },
                "emg": {"driver": "synthetic-emg", "kind": "raw", "options": {"duration_s": 8.0}},
            }
        else:
            lab = emulated_lab(folder, emg_hz=250.0, hand=True, vest=True, fingers=fingers)
            tree = stack.enter_context(lab).tree
            # A loaded machine is late now and then; that is not what is tried here.
            tree["hand"]["options"] |= {"silent_after_ms": 10_000.0, "lowest_rate_hz": 0.0}
        tree["recording"] = {"dir": str(folder / "session"), "lossless": lossless, "stop_free_mib": 16.0}
        path = folder / "settings.toml"
        path.write_text(tree_text(tree), encoding="utf-8")
        yield path


def kill_one(path: Path, after_s: float) -> Kill:
    """Start a recording by :func:`settings`, kill it ``after_s`` of its session, and read what is left."""
    note = path.with_suffix(".tick")
    with Supervisor(path, "--progress", str(note), errors=path.with_suffix(".log")) as run:
        run.start()
        if until(lambda: noted_tick_ns(note) >= 0 or not run.alive, _BEGIN_S) is None or not run.alive:
            raise RuntimeError(f"the run did not begin: {run.lines[-1:]}")
        # Not by the file: a disk that stands still would hold that up.
        began_ns = time.time_ns() - noted_tick_ns(note)
        (part,) = (path.parent / "session").glob("*.mcap.part")
        time.sleep(max(0.0, after_s - (time.time_ns() - began_ns) / 1e9))
        killed_ns = run.kill()
    left, ending = _public_reader(part)[1:]
    (recovered,) = SessionFolder(path.parent / "session").recovered
    newest, counts, _ = _public_reader(recovered.path)
    reader = McapReader(recovered.path)
    next(reader.messages(), None)
    epoch_ns = int(reader.metadata["tega"]["epoch_ns"])
    alive_ns = epoch_ns + noted_tick_ns(note)
    # A made-up source is read ahead of its time: the loop's own frames show how far it had come.
    reported = [newest.get(topic, epoch_ns) for topic in ("/hand/frames", "/vest/frame")]
    lost_s = max(0, alive_ns - max(reported)) / 1e9
    stream_lost_s = max(
        (
            max(0, alive_ns - t_ns) / 1e9
            for topic, t_ns in newest.items()
            if _steady(topic) and counts[topic] >= 10
        ),
        default=lost_s,
    )
    with recovered.path.open("rb") as file:
        from mcap.reader import make_reader

        summary = make_reader(file).get_summary()
    n_recovered = 0 if summary is None or summary.statistics is None else summary.statistics.message_count
    replay = replay_file(recovered.path)
    differ = sum(stream.differ for stream in replay.streams)
    n_messages = sum(left.values())
    good = stream_lost_s <= MOST_LOST_S and replay.same and n_recovered >= n_messages
    dropped = sum(replay.dropped.values())
    return Kill(
        at_s=(killed_ns - epoch_ns) / 1e9,
        messages=n_messages,
        ending=ending,
        lost_s=lost_s,
        stood_s=(killed_ns - alive_ns) / 1e9,
        stream_lost_s=stream_lost_s,
        recovered=n_recovered,
        dropped=dropped,
        differ=differ,
        good=good,
    )


def _steady(topic: str) -> bool:
    """Whether a stream has to come all the time; levels come ten times a second, a kept vest gets changes."""
    return topic in {"/hand/frames", "/vest/frame", "/emg/samples"} or topic.endswith("/image")


def _public_reader(path: Path) -> tuple[dict[str, int], dict[str, int], str]:
    """Read a cut file with nothing but the ``mcap`` package."""
    from mcap.reader import NonSeekingReader

    newest: dict[str, int] = {}
    counts: dict[str, int] = {}
    ending = ""
    with path.open("rb") as file:
        try:
            for _, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
                newest[channel.topic] = max(newest.get(channel.topic, 0), message.log_time)
                counts[channel.topic] = counts.get(channel.topic, 0) + 1
        except Exception as error:  # the end of a cut file, however the reader meets it
            ending = type(error).__name__
    return newest, counts, ending


def main() -> int:
    """Kill and look; return 1 unless every kill left what is promised."""
    parser = argparse.ArgumentParser(prog="python -m tega_campaigns.kills", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one object a case")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="write the page's table there")
    parser.add_argument("--instants", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    instants = random.Random(given.seed)

    def kill(after_s: float) -> Kill:
        with (
            tempfile.TemporaryDirectory() as folder,
            settings(Path(folder), synthetic=False, lossless=True) as path,
        ):
            return kill_one(path, after_s)

    at_s = [instants.uniform(0.3, _LONGEST_S) for _ in range(given.instants)]
    cases = [CampaignCase({"kill": k}, partial(kill, after_s)) for k, after_s in enumerate(at_s)]
    kills = report_cases(cases, as_json=given.json, attempts=1)
    if given.markdown is not None:
        longest = sorted(kills, key=lambda kill: -kill.stream_lost_s)[:_DISPLAYED]
        put_table(given.markdown, kill_table(longest), name="kills")
    return 0 if all(kill.good for kill in kills) else 1


def kill_table(kills: Sequence[Kill]) -> str:
    """Return the kills as a table in Markdown."""
    head = ("killed at s", "messages", "recovered", "lost s", "worst stream s", "stood s", "dropped")
    rows = [
        (
            f"{kill.at_s:.2f}",
            str(kill.messages),
            str(kill.recovered),
            *(f"{lost_s:.3f}" for lost_s in (kill.lost_s, kill.stream_lost_s, kill.stood_s)),
            str(kill.dropped),
            f"{kill.differ} rows",
            "yes" if kill.good else "**no**",
        )
        for kill in kills
    ]
    return table((*head, "replay differs", "as promised"), rows)


if __name__ == "__main__":
    sys.exit(main())
