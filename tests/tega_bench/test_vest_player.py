"""The bHaptics Player, of versions 2 and 3, against its emulator."""

from __future__ import annotations

import re
import sys
import time
import traceback
from pathlib import Path
from typing import Any

import pytest

from reference.parts import observed
from reference.vest_bench import OTHER, SILENT, TOUCH, bench, make
from tega.config import check_tree
from tega.devices.vest.player_link import PlayerLink
from tega.devices.vest.vest_player import PlayerVest
from tega.errors import DeviceUnavailableError, InvalidValueError
from tega.haptics import vest_frame
from tega.loop import LoopView, run_session
from tega.ui.view.browser.state_html import status_html
from tega.ui.view.state import ViewState
from tega_emulators.vest_bench import seen_by

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="the emulators need Linux"),
]


def test_an_address_that_cannot_be_read_is_told_and_never_the_key(tmp_path: Path) -> None:
    (tmp_path / "key").write_text("s3cr3t-key")
    options = {"version": "3", "app_id": "a", "api_key_file": tmp_path / "key", "allow_remote": True}
    for host, more in (("[::1", {}), ("", options), ("#", options)):
        with pytest.raises(DeviceUnavailableError, match=rf"host '{re.escape(host)}' is no address") as found:
            make("bhaptics-player", host=host, **more).open()
        message = "".join(traceback.format_exception(found.value))
        assert "set vest.options host" in message
        assert "s3cr3t-key" not in message
        assert "wss:" not in message


@pytest.mark.parametrize("host", ["192.0.2.7", "player.example", "0.0.0.0", "", "127.0.0.1@192.0.2.7", "::2"])
def test_another_machine_is_asked_only_where_the_settings_say_so(host: str, tmp_path: Path) -> None:
    key = tmp_path / "not-there"
    for options in ({}, {"version": "3", "app_id": "a", "api_key_file": key}):
        with pytest.raises(DeviceUnavailableError, match=r"is not this machine.*allow_remote = true"):
            make("bhaptics-player", host=host, **options).open()
    with pytest.raises(DeviceUnavailableError, match="key in not-there cannot be read"):
        make("bhaptics-player", host=host, allow_remote=True, **options).open()


def test_garbage_is_counted_and_a_vest_that_leaves_the_player_is_not_reported_as_felt() -> None:
    with bench("bhaptics-player") as made, made.vest as vest:
        made.peer.say("garbage")
        made.feed(lambda: any("could not be read and were ignored" in n for n in vest.info.notes))
        made.feed(lambda: made.shows(OTHER), OTHER)
        assert vest.counters.lost == 0
        made.feed(lambda: vest.write(0, TOUCH) == TOUCH)
        made.peer.say("no-vest")
        made.feed(lambda: not vest.write(0, TOUCH).intensities.any())
        assert any("has no vest connected" in note for note in vest.info.notes)
        made.peer.say("clear")
        made.feed(lambda: vest.write(0, TOUCH) == TOUCH)


V3 = {"version": "3", "open_timeout_s": 4.0}


def test_version_3_tells_name_link_and_battery_of_the_vest() -> None:
    with bench("bhaptics-player", **V3) as made, made.vest as vest:
        assert vest.condition == "TactSuitX40 connected, Player version 3, battery 98 %, fit unknown"
        assert not vest.info.notes
        made.peer.say("flat")
        made.feed(lambda: vest.battery_percent == 9)
        assert vest.info.notes == ("the vest's battery is at 9 %",)
        made.peer.say("no-vest")
        made.feed(lambda: not vest.write(0, TOUCH).intensities.any())
        assert vest.battery_percent is None
        assert vest.condition == "TactSuitX40 not connected, Player version 3"
    assert vest.condition == ""


def test_a_frame_of_version_3_takes_the_place_of_the_one_before_and_is_not_mixed_with_it() -> None:
    with bench("bhaptics-player", **V3) as made, made.vest:
        made.feed(lambda: made.shows(TOUCH))
        made.feed(lambda: made.shows(OTHER), OTHER)
        report = seen_by(made.peer)
    lit = [values for _, values in report.history if any(values)]
    # The emulated Player gives a motor the larger value of two requests; that lasts no longer than the second message.
    assert lit[-1] == OTHER.x40().tolist()
    assert report.errors == []


@pytest.mark.parametrize("fault", ["no-entry", "clear"])
def test_auto_asks_for_version_3_first_and_takes_what_answers(fault: str) -> None:
    with bench("bhaptics-player", version="auto") as made:
        made.peer.say(fault)
        with made.vest as vest:
            made.feed(lambda: made.shows(TOUCH))
            newer = fault == "clear"
            words = "TactSuitX40 connected, Player version 3, battery 98 %"
            older = "vest connected, Player version 2, battery unknown"
            assert vest.condition.startswith(words if newer else older)
            assert any("version 3 did not answer" in n for n in vest.info.notes) != newer
        assert seen_by(made.peer).motors == SILENT


KEYS = [
    ({}, "needs app_id"),
    ({"app_id": "a"}, "needs api_key_file"),
    ({"app_id": "a", "api_key_file": Path("/nowhere/key")}, "key in key cannot be read: FileNotFoundError"),
    ({"app_id": "a", "api_key_file": "two\nlines"}, "does not hold one key"),
    ({"app_id": "a", "api_key_file": "k" * 600}, "does not hold one key"),
    ({"app_id": "a", "api_key_file": ""}, "does not hold one key"),
    ({"app_id": "a", "api_key_file": "schlüssel"}, "cannot be read: UnicodeDecodeError"),
]


@pytest.mark.parametrize(("options", "message"), KEYS)
def test_version_3_without_id_and_key_asks_nobody(
    options: dict[str, Any], message: str, tmp_path: Path
) -> None:
    if isinstance(text := options.get("api_key_file"), str):
        (tmp_path / "key").write_text(text, encoding="utf-8")
        options = options | {"api_key_file": tmp_path / "key"}
    with pytest.raises(DeviceUnavailableError, match=message):
        make("bhaptics-player", version="3", **options).open()


def test_thirty_two_values_reach_the_rows_of_a_pro_and_a_fifth_row_is_refused() -> None:
    four_rows = vest_frame([80, 60, 40, 20], [13, 0, 100, 53], layout="paper32")
    with bench("bhaptics-player", **V3, motor_values=32) as made, made.vest as vest:
        made.feed(lambda: made.shows(four_rows), four_rows)
        with pytest.raises(
            InvalidValueError, match="motor_values is 32, and the layout 'x40' has a fifth row"
        ):
            vest.write(0, TOUCH)


def test_a_player_that_answers_no_pings_is_fed_all_the_same() -> None:
    with bench("bhaptics-player") as made:
        made.peer.say("no-pong")
        with made.vest as vest:
            made.feed(lambda: made.shows(TOUCH))
            assert any("answers no pings" in n for n in vest.info.notes)


def test_a_player_that_reads_nothing_gets_few_frames_and_no_queue() -> None:
    with bench("bhaptics-player") as made, made.vest as vest:
        made.feed(lambda: made.shows(TOUCH))
        made.peer.say("freeze")
        before = vest.counters.sent
        for k in range(30):
            vest.write(0, vest_frame([50 + 7 * k % 50, 0, 0, 0], [0, 0, 0, 0], layout="x40"))
            time.sleep(0.005)
        # What came together goes out together, what comes later waits and is replaced.
        assert 2 <= vest.counters.sent - before <= 8
        assert vest.counters.superseded >= 10
        made.peer.say("clear")
        made.feed(lambda: made.shows(OTHER), OTHER)
        assert vest.counters.lost == 0


class _Careless(PlayerVest):
    def _new_link(self) -> Any:
        link: Any = super()._new_link()
        link.ready = lambda _timeout_s: 1 // self.divisor
        return link

    divisor = 0


def test_a_bug_in_a_link_silences_the_vest_and_is_told() -> None:
    with bench("bhaptics-player") as made:
        options: Any = made.vest
        careless = made._replace(vest=_Careless(options._options))
        with careless.vest as vest:
            careless.feed(lambda: vest.counters.lost == 1)
            assert "unexpected ZeroDivisionError" in vest.info.notes[-1]
            careless.vest.divisor = 1  # type: ignore[attr-defined]
            careless.feed(lambda: careless.shows(TOUCH))
        assert seen_by(careless.peer).motors == SILENT


def test_an_encrypted_player_answers_every_opening() -> None:
    """Where one thread reads a TLS connection and another writes it, two in a hundred are never answered."""
    with bench("bhaptics-player", **V3) as made:
        for _ in range(300):
            link = PlayerLink(made.vest._options)  # type: ignore[arg-type]
            try:
                link.connect()
                assert link.present
            finally:
                link.close()


def test_a_run_shows_what_the_vest_says_of_itself(tmp_path: Path) -> None:
    displayed: list[LoopView] = []
    with bench("bhaptics-player", **V3) as made:
        vest: Any = made.vest
        names = ("port", "port_v3", "version", "app_id", "api_key_file")
        options = {name: getattr(vest._options, name) for name in names}
        settings = {
            "session": {"duration_s": 0.6},
            "tactile": {"thumb": {"driver": "synthetic-touch", "options": {"seed": 1, "duration_s": 0.6}}},
            "vest": {"driver": "bhaptics-player", "options": options},
        }
        run_session(check_tree(settings, {}, base=tmp_path).config, bus=observed(displayed.append))
    message = "TactSuitX40 connected, Player version 3, battery 98 %, fit unknown"
    assert message in {view.vest_condition for view in displayed}
    state = ViewState(0, next(view for view in displayed if view.vest_condition == message))
    assert f"<b>{message}</b>" in status_html(state)
