"""Finds how far each constant of the touch tracker may be moved before a bar on recordings or the demo is missed.

::

    TEGA_DATA=/path/to/recordings python -m tega_figures.touch_constants      # all of them, minutes each
    python -m tega_figures.touch_constants --only OVER_REST --to 1.72 --to 1.78
    python -m tega_figures.touch_constants --tables                           # the table alone

One constant is moved at a time. This tree is built once, into ``target/peers``, so that its tracker asks the
environment for its constants; the tests of recorded touch and of the demo's lifts are run with that build. What fails
is kept in ``benches/touch_constants.json``.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from typing import Final

import click

from tega_figures.touch_peers.other_build import PROJECT, TRACKER, built

__all__ = ["table"]

RESULTS: Final = PROJECT / "benches" / "touch_constants.json"
TESTS: Final = ("tests/tools/test_touch_recordings.py", "tests/tools/test_touch_demo.py")
SOURCES: Final = (TRACKER, TRACKER.replace("tracker.rs", "course.rs"))
VARIABLE: Final = "TRACKER_"
TRIED: Final[dict[str, tuple[float, ...]]] = {
    "KEPT_LOADED": (0.15, 0.18),
    "WAIT_LOADED": (1.5, 3.0),
    "FAINTER": (100.0, 150.0),
    "TRACE": (0.125, 0.135),
    "KEPT": (0.28, 0.32),
    "FALL_S": (0.3, 0.4),
    "SETTLED": (0.08, 0.12),
    "FAINT": (1.1, 1.2),
    "FAINT_S": (1.5, 2.5),
    "SUNK": (0.86, 0.9),
    "RISES": (1.1, 1.3),
    "OVER_REST": (1.7, 1.8),
    "HYSTERESIS": (0.65, 0.75),
    "REST_DOWN_S": (0.2, 0.3),
    "REST_UP_S": (12.0, 18.0),
    "FOLLOW_S": (4.0, 6.0),
    "FOLLOW_SOON_S": (0.4, 0.6),
    "SINKS_S": (0.7, 0.9),
    "LEFTOVER": (0.05, 0.07),
    "SMOOTH_S": (0.01, 0.015),
}
"""Constants of the tracker and the values that each is moved to, what limits most first."""


def chosen(name: str) -> tuple[str, float]:
    """Return the line that defines a constant of the tracker, and its value.

    Raises:
        LookupError: There is no such line.
    """
    for path in SOURCES:
        if (found := _defined(name, (PROJECT / path).read_text(encoding="utf-8"))) is not None:
            return found
    raise LookupError(f"{' and '.join(SOURCES)} have no constant {name}")


def _defined(name: str, source: str) -> tuple[str, float] | None:
    found = re.search(rf"^const {name}: f64 = ([\d.]+);$", source, re.MULTILINE)
    return None if found is None else (found[0], float(found[1]))


def asking(source: str) -> str:
    """Return a source with each of its constants asked of the environment, and as it stands where that has none."""
    for name in TRIED:
        if (found := _defined(name, source)) is None:
            continue
        line, value = found
        asked = f"asked_{name.lower()}"
        source = re.sub(rf"\b{name}\b", f"{asked}()", source.replace(line, f"@{asked}@"))
        source = source.replace(
            f"@{asked}@",
            f"fn {asked}() -> f64 {{ static AT: std::sync::LazyLock<f64> = std::sync::LazyLock::new(|| "
            f'std::env::var("{VARIABLE}{name}").map_or({value!r}, |at| at.parse().unwrap())); *AT }}',
        )
    return source


def failures(name: str, value: float) -> list[str]:
    """Run the tests with one constant moved and return those that fail."""
    sources = {path: (PROJECT / path).read_text(encoding="utf-8") for path in SOURCES}
    site = built("constants", replace={path: (source, asking(source)) for path, source in sources.items()})
    env = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")]),
        f"{VARIABLE}{name}": f"{value!r}",
    }
    command = [sys.executable, "-m", "pytest", "-q", "-n0", "--tb=no", "-p", "no:cacheprovider", "--no-skip"]
    done = subprocess.run(
        [*command, "-m", "not deep", *TESTS],
        cwd=PROJECT,
        env=env,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode not in (0, 1):
        raise RuntimeError(
            f"pytest ended with code {done.returncode}: {done.stdout[-500:]}{done.stderr[-500:]}"
        )
    return sorted(re.findall(r"^FAILED \S+::(\S+)", done.stdout, re.MULTILINE))


def table(results: dict[str, dict[str, list[str]]]) -> str:
    """Make the table of what was tried: a constant's value, values with which all holds, and others."""
    lines = ["| constant | value | all bars hold with | missed with |", "|---|---|---|---|"]
    for name, tried in results.items():
        _, value = chosen(name)
        holds = ", ".join(text for text, failed in tried.items() if not failed)
        missed = "; ".join(
            f"{text}: {', '.join(one.replace('_', ' ').removeprefix('test ') for one in failed)}"
            for text, failed in tried.items()
            if failed
        )
        lines.append(f"| `{name}` | {value:g} | {holds or '–'} | {missed or '–'} |")
    return "\n".join(lines)


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--only", multiple=True, type=click.Choice(list(TRIED)), help="This constant alone; may be repeated."
)
@click.option("--to", multiple=True, type=float, help="Move it to this value; may be repeated.")
@click.option("--missing", is_flag=True, help="Leave out what stands in the results already.")
@click.option("--tables", is_flag=True, help="Print the table of what was measured; build nothing.")
def main(*, only: tuple[str, ...], to: tuple[float, ...], missing: bool, tables: bool) -> None:
    """Move each constant of the touch tracker and print with which values every bar still holds."""
    results: dict[str, dict[str, list[str]]] = {}
    if RESULTS.is_file():
        results = json.loads(RESULTS.read_text(encoding="utf-8"))
    for name in () if tables else only or TRIED:
        for value in to or TRIED[name]:
            text = f"{value:g}"
            if missing and text in results.get(name, {}):
                continue
            failed = failures(name, value)
            tried = {**results.get(name, {}), text: failed}
            results[name] = dict(sorted(tried.items(), key=lambda one: float(one[0])))
            results = {one: results[one] for one in TRIED if one in results}
            RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
            click.echo(f"{name} = {text}: {failed}", err=True)
    click.echo(table(results))


if __name__ == "__main__":
    main()
