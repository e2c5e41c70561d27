"""``tega-teleop calibrate`` of a vest against an emulated one: what it keeps, and that the vest is left silent."""

from __future__ import annotations

import json
import re
import signal
import threading
import tomllib
from pathlib import Path

import pytest

from reference.processes import until
from reference.wizard import OnScreen, Wizard, calibrate, lab, teleop
from tega_emulators.participant import Wearer
from tega_emulators.process import Emulator
from tega_emulators.vest_bench import seen_by

pytestmark = pytest.mark.slow


def vest(peer: Emulator, *more: str) -> str:
    options = f"options = {{ port = {peer.address['port']}, limit = 40 }}"
    return "\n".join(['[vest]\ndriver = "bhaptics-player"', options, *more])


THRESHOLD = {"f1": 9, "f2": 9, "f3": 15, "f4": 9, "b1": 9, "b2": 9, "b3": 200, "b4": 9}


def test_the_vest_stays_below_its_ceiling_goes_on_where_it_was_and_ends_at_zero(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with Emulator("bhaptics_player", "--port", "0") as peer:
        file = lab(tmp_path, vest(peer))
        wearer = Wearer(lambda: seen_by(peer).history, THRESHOLD)
        how = "--person", "p01", "--json", "--time-scale", "0.2", "--ceiling", "90"
        words = ["calibrate", str(file), *how]

        def interrupted(line: str) -> None:
            if "ok front, column 3" in line:
                first.interrupt()

        first = Wizard(words, wearer, interrupted)
        first.run(130)
        until(lambda: not any(seen_by(peer).motors))
        assert f"Go on with: tega-teleop calibrate {file} --person p01" in first.said
        assert first.reported["finished"] is False
        assert first.reported["done"] == ["vest.places", "vest.threshold"]
        assert "vest: 8 of 8 places named right" in first.said
        wearer.requested.clear()
        second = Wizard(words, wearer).run()
        assert "done: vest.places, vest.threshold" in second.said
        assert "f1" not in wearer.requested[: wearer.requested.index("b4")]
        until(lambda: not any(seen_by(peer).motors))
        # 40 percent is the driver's limit; level 6 is the highest below it.
        assert wearer.loudest == 37
        assert not seen_by(peer).errors
        # At the end all columns at once, in steps.
        displayed = [max(motors) for _, motors in seen_by(peer).history if all(motors)]
        assert displayed == sorted(set(displayed))
        assert (len(displayed), displayed[-1]) == (5, 37)
        record = second.reported["files"][0]["record"]
        # Both parts count to the person's day.
        worn = json.loads((tmp_path / "calibrations/people/p01/vest-dose.json").read_bytes())
        assert [sum(run["dose_s"]) > 0 for run in worn] == [True, True]
        by_site = dict(zip(record["sites"], record["threshold_percent"], strict=True))
        assert by_site == {s: {9: 10.0, 15: 17.0, 200: -1.0}[t] for s, t in THRESHOLD.items()}
        assert record["step_percent"][0] == pytest.approx(200 / 15, abs=0.01)
        assert record["step_percent"][6] == -1
        assert record["step_sites"] == ["f4", "b2"]
        assert teleop("config", "show", str(file), "--set", "calibration.person=p01") == 0
        (line,) = [x for x in capsys.readouterr().out.splitlines() if x.startswith("vest.threshold")]
        assert "10, 10, 17, 10" in line
        assert line.endswith(f"people/p01/vest-127.0.0.1_{peer.address['port']}.toml")
        explicit = lab(tmp_path, vest(peer, "threshold = 5"))
        assert teleop("config", "show", str(explicit), "--set", "calibration.person=p01") == 0
        (line,) = [x for x in capsys.readouterr().out.splitlines() if x.startswith("vest.threshold")]
        assert " 5 " in line
        assert re.search(r"lab\.toml.* \(wins over people/p01/vest-", line)


def test_single_keys_on_a_terminal_answer_every_question_once(tmp_path: Path) -> None:
    with Emulator("bhaptics_player", "--port", "0") as peer:
        file = lab(tmp_path, vest(peer))
        wearer = Wearer(lambda: seen_by(peer).history, dict.fromkeys(THRESHOLD, 9))
        words = ["calibrate", str(file), "--person", "p01", "--time-scale", "0.1", "--ceiling", "24"]
        person = OnScreen(words, wearer)
        assert person.run(limit_s=10.0) == 0, person.screen[-3000:]
        (kept,) = (tmp_path / "calibrations/people/p01").glob("vest-*.toml")
        record = tomllib.loads(kept.read_text())
        # On a busy machine so short a vibration may be missed, which makes a threshold higher, never lower.
        assert min(record["threshold_percent"]) >= 10
        assert record["named_right"] == record["named"] == 8
        until(lambda: not any(seen_by(peer).motors))
        # One key for each vibration that was asked about, none for nothing.
        n_bursts = len(wearer.requested)
        assert n_bursts > 40
        assert person.n_keys >= n_bursts


def test_a_mirrored_back_is_told_and_the_vest_rests_after_sigterm(tmp_path: Path) -> None:
    with Emulator("bhaptics_player", "--port", "0") as peer:
        file = lab(tmp_path, vest(peer))
        wizard = calibrate(file, Wearer(lambda: seen_by(peer).history, THRESHOLD, mirrored=True), code=130)
        assert 'back felt mirrored: set vest.mirror = "back"' in wizard.said

        def while_it_vibrates() -> None:
            until(lambda: any(seen_by(peer).motors))
            again.terminate()

        def begins(prompt: str) -> str:
            assert "Something will vibrate" in prompt
            threading.Thread(target=while_it_vibrates).start()
            return ""

        again = Wizard(["calibrate", str(file), "--person", "p02", "--time-scale", "4"], begins)
        again.run(128 + signal.SIGTERM)
        until(lambda: not any(seen_by(peer).motors))
        wizard = calibrate(file, Wearer(lambda: seen_by(peer).history, THRESHOLD), "--yes", code=1)
        assert "its questions need a person to answer them" in wizard.said
