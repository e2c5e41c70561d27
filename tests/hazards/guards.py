"""Lists the guards that can be taken out, or made ten times as slow, with the test that fails then."""

from __future__ import annotations

import ast
import re
from typing import Final

from hazards.guard import DEVICE_TIMES, PICTURES, TIMES, VOTES, Guard
from hazards.guards_of_devices import OF_DEVICES
from hazards.guards_of_runs import OF_RUNS

__all__ = ["GUARDS", "LATE", "Guard"]

GUARDS: Final = (*OF_DEVICES, *OF_RUNS)
"""Every guard, with what shows that it is needed."""


def _late(subject: str, old: str, shown_by: str, times: float = 10) -> Guard:
    """Return the guard whose time, the last number of ``old``, is ten times as long; of a rate a tenth."""
    number = re.findall(r"\d[\d._e]*", old)[-1]
    before, _, after = old.rpartition(number)
    longer = f"{before}{ast.literal_eval(number) * times!r}{after}"
    return Guard(f"{subject} takes ten times as long", old, longer, shown_by)


LATE: Final = (
    _late(
        "the way back of what a reflex added",
        "_BACK_LEVELS_PER_S: Final = 5.0",
        f"{TIMES}what_a_reflex_added_is_taken_back_within_200_ms_of_a_hold",
        0.1,
    ),
    _late(
        "the vest's watchdog",
        "WATCHDOG_S: Final = 0.2",
        f"{DEVICE_TIMES}a_vest_that_is_told_nothing_rests_within_200_ms",
    ),
    _late(
        "a vest that takes no frame",
        "_STALLED_S = 1.0  #",
        f"{DEVICE_TIMES}a_vest_that_takes_no_frame_counts_as_lost_after_a_second",
    ),
    _late(
        "a stale finger",
        "\nSTALE_NS = 100_000_000",
        f"{TIMES}a_stale_finger_is_silent_after_100_ms_and_a_refresh",
    ),
    _late(
        "a lost picture",
        "_STALE_PICTURE_NS = 100_000_000",
        f"{TIMES}a_lost_picture_holds_within_120_ms_where_the_settings_say_so",
    ),
    _late(
        "a look at everything",
        "_POLL_NS = 10_000_000",
        f"{TIMES}a_dead_man_a_late_loop_and_a_lost_link_hold_at_the_next_look",
    ),
    _late(
        "a late loop",
        "msgspec.Meta(ge=5, le=5000)] = 100.0",
        f"{TIMES}a_dead_man_a_late_loop_and_a_lost_link_hold_at_the_next_look",
    ),
    _late(
        "lost EMG",
        "msgspec.Meta(ge=20, le=5000)] = 150.0",
        f"{TIMES}emg_lost_holds_within_260_ms_of_its_last_block_and_opens_2_s_later",
    ),
    _late(
        "a hold",
        "hold_ms: _Ms = 2000.0",
        f"{TIMES}emg_lost_holds_within_260_ms_of_its_last_block_and_opens_2_s_later",
    ),
    _late(
        "a stuck electrode", "\n_STUCK_S = 0.1", f"{VOTES}a_fault_of_every_channel_keeps_the_level_before_it"
    ),
    _late("mains", "_MAINS_S = 0.2", f"{VOTES}a_fault_of_every_channel_keeps_the_level_before_it"),
    _late(
        "a camera's way back",
        "_BACK_NS = 500_000_000",
        f"{PICTURES}a_dark_camera_has_no_vote_until_half_a_second_after_the_last_dark_picture",
    ),
    _late(
        "a tracker's way back",
        "_STEADY_MS = 500.0",
        "tests/tega/unit/test_arm.py::test_a_tracker_that_jumps_away_and_back_has_no_vote_until_it_is_steady",
    ),
    _late(
        "a tracker that does not come back",
        "    lost_ms: _Ms = 250.0",
        "tests/tega/unit/test_arm.py::test_a_jump_is_believed_once_the_hand_was_lost",
    ),
    _late(
        "no news on the page",
        "NO_NEWS_S: Final = 1.5",
        f"{TIMES}a_page_without_news_says_so_after_a_second_and_a_half",
    ),
    _late(
        "a silent hand",
        "msgspec.Meta(ge=10, le=10_000)] = 30.0",
        f"{DEVICE_TIMES}a_silent_hand_is_let_go_within_30_ms",
    ),
    _late(
        "a slow hand",
        "msgspec.Meta(ge=0, le=1000)] = 250.0",
        f"{DEVICE_TIMES}a_slow_hand_is_let_go_within_a_second",
        0.1,
    ),
    _late(
        "a program that stands still",
        "STUCK_S: Final = 1.0",
        f"{DEVICE_TIMES}a_program_that_stands_still_is_taken_over_from_within_a_second",
    ),
    _late(
        "a Bluetooth vest's program that stands still",
        "STUCK_S: Final = 1.0",
        f"{DEVICE_TIMES}a_bluetooth_vest_is_silenced_within_a_second_of_a_standstill",
    ),
    _late(
        "a Bluetooth vest that takes no zeros",
        "_CALL_S = 1.5",
        f"{DEVICE_TIMES}a_bluetooth_vest_that_takes_no_zeros_is_left_to_its_guard_after_a_second_and_a_half",
    ),
    _late(
        "a hand that does not hear its end",
        "CONFIRM_S = 3.0",
        f"{DEVICE_TIMES}a_hand_that_does_not_hear_its_end_is_left_to_its_guard_after_three_seconds",
    ),
    _late(
        "a guard that stands still",
        "DEAF_S: Final = 2.0",
        f"{DEVICE_TIMES}a_guard_that_stands_still_is_replaced_within_two_seconds",
    ),
    _late(
        "a dead-man that says nothing",
        "if t_ns - self._received_ns > limit_ms * 1e6:",
        f"{TIMES}a_dead_man_that_says_nothing_is_let_go_after_its_time",
    ),
    _late("an old message", "ttl_ms: _Ms = 100.0", f"{TIMES}a_message_older_than_100_ms_is_not_used"),
)
"""The times of the hazard table, each ten times as long, with the test on a clock of its own that fails then."""
