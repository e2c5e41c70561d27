"""Measure run times and instruction counts, and write the tables of docs/evidence/pareto.md: `make figures`.

The tables are made from `results.json`, which is committed beside this file; `--tables` makes them again
without measuring, and a test holds the page to them. Numba asks for an older NumPy, so times are measured in an
environment of their own, `target/figures`. Measure on a machine that does nothing else.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
import venv
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parent
RESULTS = HERE / "results.json"
PAGE = PROJECT / "docs" / "evidence" / "pareto.md"
PICTURE = PROJECT / "docs" / "images" / "pareto.png"

FLOOR, NUMPY_FLOOR = "both images read once", "both images read once, NumPy"
FINGER = [320, 240]
LAWS = {"rectified, spatial": "rectified", "signed, spatial": "signed", "absolute, spatial": "absolute"}
ERRORS = {
    "centroid_px": "centroid, px",
    "spread_relative": "σ, relative",
    "eda_pixels": "EDA, pixels",
    "cci_relative": "CCI, relative",
}

Rows = list[dict[str, Any]]


def measure() -> None:
    """Run the bench in an environment that has every peer, and write its results and its picture."""
    place = PROJECT / "target" / "figures"
    python = place / ("Scripts" if os.name == "nt" else "bin") / "python"
    if not python.exists():
        project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        extras = project["optional-dependencies"]
        # The package itself is taken from here, so the extra that names another one is spelt out.
        packages = [*project["dependencies"], *extras["bench"], *extras["pictures"], "numba"]
        packages = [package for package in packages if not package.startswith("tega[")]
        venv.create(place, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *packages], check=True)
    command = [python, "-m", "tega.ui.cli", "bench", "--json", "--picture", str(PICTURE)]
    sources = (PROJECT / "python", PROJECT / "tools" / "figures")
    env = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, sources))}
    message = subprocess.run(command, check=True, env=env, stdout=subprocess.PIPE, text=True).stdout
    RESULTS.write_text(json.dumps(rounded(json.loads(message)), indent=1) + "\n", encoding="utf-8")


def rounded(tree: Any) -> Any:
    """Return the results with four significant digits, which is more than a time has."""
    if isinstance(tree, dict):
        return {key: rounded(value) for key, value in tree.items()}
    if isinstance(tree, list):
        return [rounded(value) for value in tree]
    return float(f"{tree:.4g}") if isinstance(tree, float) else tree


def table(head: list[str], rows: list[list[str]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def error(value: float | None) -> str:
    """Return an error as a table shows it."""
    return "–" if value is None else "**0**" if value == 0 else f"{value:.0e}".replace("e-0", "e-")


def machine(results: dict[str, Any]) -> str:
    """Say what was measured on."""
    own = results["machine"]
    load = own["load_per_core"]
    versions = ", ".join(f"{name} {version}" for name, version in own["versions"].items())
    missing = ", ".join(results["missing"]) or "nothing"
    known = "of unknown load" if load is None else f"load {load:g} a core at the start"
    return (
        f"Measured on {own['cpu']}, {own['n_cores']} cores, {known}, {own['instruction_set']}; {own['system']}; "
        f"{versions}. Not installed: {missing}."
    )


def contact(results: dict[str, Any]) -> str:
    """Compare the ways to compute contact metrics at a finger's size."""
    rows = [r for r in results["contact"] if r["size"] == FINGER and r["reading"] in LAWS]
    of = {(r["reading"], r["variant"]): r for r in rows}
    variants = list(dict.fromkeys(r["variant"] for r in rows))
    lines = []
    for variant in sorted(variants, key=lambda v: of["rectified, spatial", v]["to_floor"]):
        own = [of[law, variant] for law in LAWS]
        worst = {key: max((r["error"][key] for r in own if r["error"]), default=None) for key in ERRORS}
        name = f"**{variant}**" if variant.startswith("TEGA") else variant
        times = [f"{r['to_floor']:.2f} ({r['time']['median_us']:.1f} µs)" for r in own]
        displayed = [
            f"{value:,.0f}" if key == "eda_pixels" and value else error(value) for key, value in worst.items()
        ]
        lines.append([name, *times, *displayed])
    return table(["", *LAWS.values(), *ERRORS.values()], lines)


def headline(results: dict[str, Any]) -> str:
    """Say how the kernels compare with whatever is fastest beside them."""
    rows = [r for r in results["contact"] if r["size"] == FINGER and r["reading"] in LAWS]
    parts = []
    for law, name in LAWS.items():
        [ours] = [r for r in rows if (r["reading"], r["variant"]) == (law, "TEGA")]
        peer = fastest([r for r in rows if r["reading"] == law])
        parts.append(f"{name} in {ours['to_best_peer']:.2f} of the time of {peer}")
    return f"Over the fastest peer, in the same run: {'; '.join(parts)}."


def fastest(rows: Rows) -> str:
    """Return the name of the fastest variant that is neither ours nor a floor."""
    peers = [
        r for r in rows if not r["variant"].startswith("TEGA") and r["variant"] not in {FLOOR, NUMPY_FLOOR}
    ]
    return str(min(peers, key=lambda r: r["time"]["median_us"])["variant"])


def sizes(results: dict[str, Any]) -> str:
    """Show how times grow with the picture."""
    wanted = {("rectified, spatial", "TEGA"): "rectified", ("signed, spatial", "TEGA"): "signed",
              ("presets", "TEGA, live"): "`live`", ("presets", "TEGA, paper"): "`paper`",
              ("rectified, spatial", FLOOR): "floor"}  # fmt: skip
    of = {(r["reading"], r["variant"], tuple(r["size"])): r for r in results["contact"]}
    found = sorted({tuple(r["size"]) for r in results["contact"]}, key=lambda size: size[0])
    lines = [
        [
            name,
            *(
                f"{of[law, variant, size]['time']['median_us'] * 1000 / (size[0] * size[1]):.2f}"
                for size in found
            ),
        ]
        for (law, variant), name in wanted.items()
    ]
    return table(["ns a pixel", *(f"{height}×{width}" for height, width in found)], lines)


def widths(results: dict[str, Any]) -> str:
    """Show the least and the most that each kernel takes over all widths."""
    shapes = {"upright": (True, False), "lying": (False, False), "upright, rows apart": (True, True)}
    lines = []
    for ratios, kernel in [(r, k) for r in ("to_floor", "peer_to_ours") for k in results["widths"][0][r]]:
        line = [kernel if ratios == "to_floor" else f"OpenCV's fastest form over {kernel}"]
        for shape in shapes.values():
            found = [
                r[ratios][kernel]
                for r in results["widths"]
                if (r["size"][0] > r["size"][1], r["strided"]) == shape
            ]
            line.append(f"{min(found):.2f} to {max(found):.2f}")
        lines.append(line)
    return table(["over NumPy's or-reduce", *shapes], lines)


def emg(results: dict[str, Any]) -> str:
    """Compare the low-passes."""
    of = {(r["case"], r["variant"]): r for r in results["emg"]}
    lines = []
    for variant in dict.fromkeys(r["variant"] for r in results["emg"]):
        block, bulk, one = (of[case, variant] for case in ("block", "bulk", "one channel"))
        name = f"**{variant}**" if variant == "TEGA" else variant
        ratios = [f"{r['to_best_peer']:.2f}" for r in (block, bulk, one)]
        lines.append([name, f"{block['time']['median_us']:.2f}", ratios[0], f"{bulk['ns_per_sample']:.2f}", ratios[1],
                      f"{one['ns_per_sample']:.2f}", ratios[2], error(block["error_of_full_scale"])])  # fmt: skip
    head = ["", f"{of['block', 'TEGA']['n_rows']} rows, µs", "over the fastest peer", "in bulk, ns a sample",
            "over the fastest peer", "one channel in bulk", "over the fastest peer",
            "largest error over full scale"]  # fmt: skip
    return table(head, lines)


def tick(results: dict[str, Any]) -> str:
    """Show what a whole tick takes."""
    lines = [
        [f"`{r['reading']}`", str(r["n_in_contact"]), *(f"{r['stages_us'][stage]:.1f}" for stage in r["stages_us"]),
         f"{r['total']['median_us']:.0f}"]
        for r in results["tick"]
    ]  # fmt: skip
    return table(["touch", "fingers in contact", *results["tick"][0]["stages_us"], "in all"], lines)


def page(text: str, results: dict[str, Any]) -> str:
    """Return the page with every generated part made anew.

    Raises:
        SystemExit: The page has a part that nothing makes, or lacks one.
    """
    makers = {f.__name__: f for f in (machine, headline, contact, sizes, widths, emg, tick)}
    parts = {name: make(results) for name, make in makers.items()}
    found = re.findall(r"<!-- made: (\w+) -->", text)
    if sorted(found) != sorted(parts):
        raise SystemExit(f"{PAGE.name} has the parts {found}, and {list(parts)} are made")
    for name, part in parts.items():
        mark = re.escape(f"<!-- made: {name} -->")
        # A part goes as far as the next empty line.
        text = re.sub(f"(?<={mark}\n).*?(?=\n\n)", lambda _, p=part: p, text, flags=re.DOTALL)
    return text


def made() -> str:
    """Return the page as it is to be."""
    results = json.loads(RESULTS.read_text(encoding="utf-8"))
    return page(PAGE.read_text(encoding="utf-8"), results)


def main() -> None:
    """Measure unless told not to, then write the page."""
    if "--tables" not in sys.argv[1:]:
        measure()
        subprocess.run([sys.executable, HERE / "counts.py", "--update"], check=True)
    PAGE.write_text(made(), encoding="utf-8")


if __name__ == "__main__":
    main()
