"""Check drivers and stages against their contracts, by their names."""

from __future__ import annotations

import argparse
import sys
import tempfile
import traceback
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from tega.devices.registry import driver_class, driver_names
from tega.errors import TegaError
from tega.haptics.motor_layout import find_layout
from tega.runtime.words import nearest_hint
from tega.setup.contract.check import check_driver
from tega.setup.contract.stages import check_stage
from tega.stages.registry import GROUPS, find_stages, stage_class, stage_names


def main(arguments: Sequence[str] | None = None) -> int:
    """Check drivers and stages by name and print a line for each.

    Return 0; 1 if one broke a rule, 2 if one could not be tried.
    """
    parser = argparse.ArgumentParser(
        prog="python -m tega.setup.contract", description="Put drivers and stages through their contracts."
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="names of entry points; none: all of them")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        dest="sets",
        help="an option of the driver or stage",
    )
    parser.add_argument(
        "--real", action="store_true", help="TEGA's own drivers on the device itself, not on its emulator"
    )
    given = parser.parse_args(arguments)
    if given.sets and len(given.names) != 1:
        parser.error("--set needs the name of one driver or stage")
    worst = 0
    everything = [*driver_names(), *dict.fromkeys(name for group in GROUPS for name in stage_names(group))]
    if unknown := [name for name in given.names if name not in everything]:
        hint = nearest_hint(unknown[0], everything, "drivers and stages:")
        parser.error(f"no driver or stage is called {unknown[0]!r}; {hint}")
    for name in given.names or everything:
        if name not in driver_names():
            verdict, text = _try_stages(name, given.sets)
        else:
            verdict, text = _try_driver(name, given.sets, real=given.real)
        worst = max(worst, {"ok": 0, "not tried": 0 if not given.names else 2, "broken": 1}[verdict])
        sys.stdout.write(f"{verdict:<10} {name:<18} {text}\n")
        sys.stdout.flush()
    return worst


def _try_stages(name: str, sets: Sequence[str]) -> tuple[str, str]:
    """Check every stage of a name; return the verdict and its text."""
    from tega.config import stage_options

    groups = find_stages(name)
    try:
        for group in groups:
            if group == "layout":
                check_stage(find_layout(name))
            else:
                check_stage(stage_class(group, name), stage_options(group, name, sets=sets))
    except Exception as error:  # whatever a stage in the making does
        return _failed(error)
    return "ok", f"{' and '.join(groups)}, {'with ' + ' '.join(sets) if sets else 'with its default options'}"


def _failed(error: Exception, where: str = "") -> tuple[str, str]:
    """Return the verdict on a driver or stage whose check ended with an error, and its text."""
    if isinstance(error, AssertionError):
        return "broken", f"rule: {error}{where}"
    if isinstance(error, TegaError):
        return "not tried", str(error)
    sys.stderr.write(traceback.format_exc())
    return "broken", f"it raised {type(error).__name__}: {error}{where}"


def _try_driver(name: str, sets: Sequence[str], *, real: bool) -> tuple[str, str]:
    from tega.config import driver_options
    from tega.runtime.lifecycle import needs_tools

    with ExitStack() as stack:
        tree: dict[str, Any] = {}
        where = "with its default options"
        try:
            driver = driver_class(name)
            if sets:
                where = f"with {' '.join(sets)}"
            elif driver.__module__.startswith("tega.") and not real:
                with needs_tools(f"python -m tega.setup.contract {name}"):
                    from tega_emulators.benches import BENCHES, why_not
                if reason := why_not(name):
                    return "not tried", reason
                where = BENCHES[name].summary
                folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
                tree = stack.enter_context(BENCHES[name].start(folder))
            check_driver(driver, driver_options(name, tree, sets=sets))
        except Exception as error:  # whatever a driver in the making does
            return _failed(error, f" ({where})")
    return "ok", where
