"""A guard that can be taken out, and where the tests stand that show it."""

from __future__ import annotations

from typing import Final, NamedTuple

LOST: Final = "tests/hazards/test_lost.py::test_"
MUSCLES: Final = "tests/hazards/test_lost_muscles.py::test_"
STOP: Final = "tests/hazards/test_stop.py::test_"
LAWS: Final = "tests/tega/property/test_safety.py::test_"
HAND: Final = "tests/tega/unit/test_hand_guard.py::test_"
NAMES: Final = "tests/together/test_hostile_names.py::test_"
TIMES: Final = "tests/hazards/test_times.py::test_"
DEVICE_TIMES: Final = "tests/hazards/test_device_times.py::test_"
VOTES: Final = "tests/tega/unit/test_emg_votes.py::test_"
LEAD: Final = "tests/tega_study/test_study_lead.py::test_"
DISK: Final = "tests/tools/test_recording_disk.py::test_"
PLAN: Final = "tests/tega_study/test_study_plan.py::test_"
PAGE: Final = "tests/tega_sim/test_view_browser.py::test_"
FOREIGN: Final = "tests/tega/property/test_foreign_files.py::test_"
PICTURES: Final = "tests/tega/unit/test_picture_votes.py::test_"
VESTS: Final = "tests/tega_bench/test_vests.py::test_"
START: Final = "tests/tega_study/test_arm_to_start.py::test_"
REFLEX: Final = "tests/tega/property/test_reflex.py::test_"
STAND: Final = "tests/tega/unit/test_hand_standstill.py::test_"
LIMB: Final = "tests/tega/unit/test_limb_loss.py::test_"


class Guard(NamedTuple):
    """A guard that can be taken out.

    Attributes:
        what: What is then so.
        old: The text that does it; stands once in ``python/tega``.
        new: What stands there without it.
        shown_by: The test that fails then; or ``soak HOW DEVICE``, a soak of that fault alone.
    """

    what: str
    old: str
    new: str
    shown_by: str
