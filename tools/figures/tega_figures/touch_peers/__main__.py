"""Write the tables of ``docs/evidence/touch-peers.md``: recorded sets, every reading on the same frames in one run.

::

    TEGA_DATA=/path/to/recordings python -m tega_figures.touch_peers
    python -m tega_figures.touch_peers --tables

The first reads all sets and writes ``benches/touch_peers.json`` and the page; the second makes
the page's tables from that file again.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

import click
import numpy as np

from tega_figures.touch_peers.force import force_errors
from tega_figures.touch_peers.readings import MOG2, PROJECT, makers, pytouch_area
from tega_figures.touch_peers.sets import SETS, Figure

RESULTS: Final = PROJECT / "benches" / "touch_peers.json"
PAGE: Final = PROJECT / "docs" / "evidence" / "touch-peers.md"


def _score(figures: list[Figure]) -> float:
    """How good a way of background subtraction is on one set, to choose the best."""
    high = [f.value for f in figures if f.wanted == "high" and not f.what.startswith("rank")]
    ranks = [f.value for f in figures if f.what.startswith("rank")]
    low = [f.value for f in figures if f.wanted == "low" and not np.isnan(f.value)]
    return float(np.mean(high or [0.0]) - np.mean(low or [0.0]) + 0.1 * np.mean(ranks or [0.0]))


def measure(folder: Path) -> dict[str, Any]:
    """Read every set with every reading."""
    pytouch, message = pytouch_area()
    readings = makers(pytouch)
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    ways: dict[str, str] = {}
    for name, judge in SETS.items():
        click.echo(name, err=True)
        found = {}
        for reading, make in readings.items():
            found[reading] = list(judge(folder, make))
            click.echo(f"  {reading}", err=True)
        best = max((r for r in found if r.startswith(MOG2)), key=lambda r: _score(found[r]))
        ways[name] = best.removeprefix(f"{MOG2}, ")
        kept = {r: f for r, f in found.items() if not r.startswith(MOG2)} | {MOG2: found[best]}
        for reading, figures in kept.items():
            for f in figures:
                row = rows.setdefault(
                    (f.set, f.what),
                    {"set": f.set, "what": f.what, "n": f.n, "wanted": f.wanted, "values": {}},
                )
                row["values"][reading] = None if np.isnan(f.value) else round(f.value, 4)
    commit = subprocess.run(
        ["git", "-C", str(PROJECT), "rev-parse", "--short", "HEAD"],
        check=True,
        capture_output=True,
        text=True,
    )
    return {
        "commit": commit.stdout.strip(),
        "pytouch": message,
        "ways_of_background_subtraction": ways,
        "rows": list(rows.values()),
        "force": [
            e._asdict() | {k: _rounded(v) for k, v in e._asdict().items() if isinstance(v, float | tuple)}
            for e in force_errors(folder)
        ],
    }


def measure_cost() -> list[dict[str, Any]]:
    """Measure what a frame costs in five processes; the one whose floor is in the middle counts."""
    command = [sys.executable, "-m", "tega_figures.touch_peers.cost"]
    runs = [
        json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        for _ in range(5)
    ]
    return [sorted(runs, key=lambda run: run["rows"][0]["median_us"])[2]]


def _rounded(value: Any) -> Any:
    return [round(v, 4) for v in value] if isinstance(value, tuple) else round(value, 4)


def peers(results: dict[str, Any]) -> str:
    """Make the table of all readings."""
    names = list(results["rows"][0]["values"])
    lines = [["set", "what", "n", *names]]
    for row in results["rows"]:
        plain = row["what"].startswith(("rank", "overlap", "area"))
        values = [
            "–" if (v := row["values"].get(name)) is None else f"{v:.2f}" if plain else f"{100 * v:.1f} %"
            for name in names
        ]
        lines.append([f"`{row['set']}`", row["what"], str(row["n"]), *values])
    return _table(lines)


def ways(results: dict[str, Any]) -> str:
    """Say how background subtraction was set, and how PyTouch came here."""
    message = "; ".join(
        f"`{name}`: {route}" for name, route in results["ways_of_background_subtraction"].items()
    )
    return f"Background subtraction's best way on each set: {message}. {results['pytouch']}"


def force(results: dict[str, Any]) -> str:
    """Make the table of the force's error."""
    lines = [["set", "calibrated by", "clips", "frames", "reported over true", "relative error", "95 % interval",
              "within 25 %"]]  # fmt: skip
    for e in results["force"]:
        low, high = e["interval"]
        lines.append([
            f"`{e['set']}`", e["calibrated"], str(e["n_clips"]), str(e["n_frames"]), f"{e['read_over_true']:.2f}",
            f"{100 * e['error']:.0f} %", f"{100 * low:.0f} to {100 * high:.0f} %", f"{100 * e['within_quarter']:.0f} %",
        ])  # fmt: skip
    return _table(lines)


def cost(results: dict[str, Any]) -> str:
    """Make the table of what a frame costs."""
    sets = results["cost"]
    head = ["240 x 320", *(f"{one['instruction_set']}: {subject}" for one in sets for subject in
                           ("over the or-reduce", "µs, median", "µs, fastest tenth"))]  # fmt: skip
    lines = [head]
    for rows in zip(*(one["rows"] for one in sets), strict=True):
        cells = [f"{row[key]:g}" for row in rows for key in ("over_floor", "median_us", "fastest_tenth_us")]
        lines.append([rows[0]["what"], *cells])
    return _table(lines)


def _table(lines: list[list[str]]) -> str:
    head, *rest = lines
    return "\n".join("| " + " | ".join(line) + " |" for line in [head, ["---"] * len(head), *rest])


def page(text: str, parts: dict[str, str]) -> str:
    """Return a page with its made parts anew."""
    for name, part in parts.items():
        head, found, rest = text.partition(f"<!-- made: {name} -->\n")
        _, end, after = rest.partition("\n<!-- end -->")
        if not found or not end:
            raise SystemExit(f"{PAGE.name} has no part {name!r}")
        text = f"{head}{found}\n{part}\n{end}{after}"
    return text


def parts(results: dict[str, Any]) -> dict[str, str]:
    """Return the made parts of the page by name."""
    return {f.__name__: f(results) for f in (peers, ways, force, cost)}


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--tables", is_flag=True, help="Make the page from the committed figures; measure nothing.")
@click.option("--cost-only", is_flag=True, help="Measure what a frame costs, and leave the rest as it is.")
def main(*, tables: bool, cost_only: bool) -> None:
    """Measure unless told not to, then write the page."""
    results = json.loads(RESULTS.read_text(encoding="utf-8")) if tables or cost_only else {}
    if not (tables or cost_only):
        folder = Path(os.environ.get("TEGA_DATA", "../shared/data")) / "digit"
        results = measure(folder)
        RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    if not tables:
        results["cost"] = measure_cost()
        RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8"), parts(results)), encoding="utf-8")


if __name__ == "__main__":
    main()
