"""Guards that can be taken out, and times that can be ten times as long, with the test that fails then."""

from __future__ import annotations

import ast
import re
from typing import Final, NamedTuple

__all__ = ["LATE", "Guard"]


class Guard(NamedTuple):
    """A guard that can be taken out.

    Attributes:
        what: What is then so.
        needed_by: The test that fails then, ``folder/file::name``.
        old: The text that does it; stands once in ``python``.
        new: What stands there without it. If ``None``, a condition is never met, a line is skipped, and any other text
            is left out.
    """

    what: str
    needed_by: str
    old: str
    new: str | None = None

    @property
    def shown_by(self) -> str:
        """The test as pytest names it."""
        return "tests/{}.py::test_{}".format(*self.needed_by.split("::"))

    @property
    def without(self) -> str:
        """The text that stands there without it."""
        if self.new is not None:
            return self.new
        line = re.match(r"( {4,})?(if )?", self.old)
        assert line is not None
        indent, condition = line.groups(default="")
        return indent + ("if False:" if condition else "pass" if indent else "")


_RATES: Final = ("_BACK_LEVELS_PER_S: Final = 5.0", "msgspec.Meta(ge=0, le=1000)] = 250.0")
_TIMES: Final = {
    "hazards/test_times::what_a_reflex_added_is_taken_back_within_200_ms_of_a_hold": (
        "_BACK_LEVELS_PER_S: Final = 5.0",
    ),
    "hazards/test_device_times::a_vest_that_is_told_nothing_rests_within_200_ms": (
        "WATCHDOG_S: Final = 0.2",
    ),
    "hazards/test_device_times::a_vest_that_takes_no_frame_counts_as_lost_after_a_second": (
        "_STALLED_S = 1.0  #",
    ),
    "hazards/test_times::a_stale_finger_is_silent_after_100_ms_and_a_refresh": ("\nSTALE_NS = 100_000_000",),
    "hazards/test_times::a_lost_picture_holds_within_120_ms_where_the_settings_say_so": (
        "_STALE_PICTURE_NS = 100_000_000",
    ),
    "hazards/test_times::emg_without_a_vote_a_dead_man_a_late_loop_and_a_lost_link_hold_at_the_next_look": (
        "_POLL_NS = 10_000_000",
        "msgspec.Meta(ge=5, le=5000)] = 100.0",
    ),
    "hazards/test_times::emg_lost_holds_within_260_ms_of_its_last_block_and_opens_2_s_later": (
        "msgspec.Meta(ge=20, le=5000)] = 150.0",
        "hold_ms: _Ms = 2000.0",
    ),
    "tega/unit/test_emg_votes::a_fault_of_every_channel_keeps_the_level_before_it": (
        "\n_STUCK_S = 0.1",
        "_MAINS_S = 0.2",
    ),
    "tega/unit/test_repeats::a_dark_camera_has_no_vote_until_half_a_second_after_the_last_dark_picture": (
        "_BACK_NS = 500_000_000",
    ),
    "tega/unit/test_arm::a_tracker_that_jumps_away_and_back_has_no_vote_until_it_is_steady": (
        "_STEADY_MS = 500.0",
    ),
    "tega/unit/test_arm::a_jump_is_believed_once_the_hand_was_lost": ("    lost_ms: _Ms = 250.0",),
    "hazards/test_times::a_page_without_news_says_so_after_a_second_and_a_half": ("NO_NEWS_S: Final = 1.5",),
    "hazards/test_device_times::a_silent_hand_is_let_go_within_30_ms_and_a_slow_one_within_a_second": (
        "msgspec.Meta(ge=10, le=10_000)] = 30.0",
        "msgspec.Meta(ge=0, le=1000)] = 250.0",
    ),
    "hazards/test_device_times::a_program_that_stands_still_is_taken_over_from_within_a_second": (
        "STUCK_S: Final = 1.0",
    ),
    "hazards/test_device_times::a_bluetooth_vest_that_takes_no_zeros_is_left_to_its_guard_after_a_second_and_a_half": (
        "_CALL_S = 1.5",
    ),
    "hazards/test_device_times::a_hand_that_does_not_hear_its_end_is_left_to_its_guard_after_three_seconds": (
        "CONFIRM_S = 3.0",
    ),
    "hazards/test_device_times::a_guard_that_stands_still_is_replaced_within_two_seconds": (
        "DEAF_S: Final = 2.0",
    ),
    "hazards/test_times::a_dead_man_that_says_nothing_is_let_go_after_its_time": (
        "if t_ns - self._received_ns > limit_ms * 1e6:",
    ),
    "hazards/test_times::a_message_older_than_100_ms_is_not_used": ("ttl_ms: _Ms = 100.0",),
}


def _late(needed_by: str, old: str) -> Guard:
    """Return the guard whose time, the last number of ``old``, is ten times as long; of a rate a tenth."""
    before, number, after = re.split(r"(\d[\d._e]*)(?!.*\d)", old)
    longer = ast.literal_eval(number) * (0.1 if old in _RATES else 10)
    return Guard(f"ten times as long: `{old.strip()}`", needed_by, old, f"{before}{longer!r}{after}")


LATE: Final = tuple(_late(test, old) for test, times in _TIMES.items() for old in times)
"""The times of the hazard table, each ten times as long, with the test on a clock of its own that fails then."""
