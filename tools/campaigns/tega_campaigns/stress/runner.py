"""All cases, in the order of the page."""

from __future__ import annotations

from collections.abc import Callable

from tega_campaigns.stress.case import StressCase
from tega_campaigns.stress.emg import EMG_CASES
from tega_campaigns.stress.long_run import LONG_CASES
from tega_campaigns.stress.sigmoid import SIGMOID_CASES
from tega_campaigns.stress.touch import TOUCH_CASES
from tega_campaigns.stress.transfer_function import FORM_CASES

__all__ = ["run_stress"]


def run_stress(
    *, quick: bool = False, tell: Callable[[str, int, int], None] = lambda _what, _done, _total: None
) -> list[StressCase]:
    """Run every case.

    Args:
        quick: Take a million samples where the full run takes a hundred million.
        tell: Called with a case's name, how many are done, and how many there are.

    Returns:
        The cases in the order of the page.
    """
    cases = [*TOUCH_CASES, *SIGMOID_CASES, *EMG_CASES, *LONG_CASES, *FORM_CASES]
    results = []
    for done, case in enumerate(cases):
        tell(case.__name__.strip("_").replace("_", " "), done, len(cases))
        results += case(quick=quick)
    return results
