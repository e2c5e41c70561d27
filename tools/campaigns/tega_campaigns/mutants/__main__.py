"""Command line of the campaign of changes: ``python -m tega_campaigns.mutants``."""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Final

from tega.runtime.child_process import python_environment
from tega_campaigns.mutants.drawn import python_mutants, rust_mutants
from tega_campaigns.mutants.tried import (
    Covered,
    beside_python,
    kept,
    progress,
    try_python,
    try_rust,
)

_SETTINGS: Final = """[run]
parallel = True
context = ${{PYTEST_CURRENT_TEST-}}
data_file = {folder}/covered
source = {tree}/python/tega
patch = _exit
disable_warnings = module-not-measured, no-data-collected
"""


def cover(project: Path, folder: Path) -> None:
    """Run the tests that need no waiting, folder by folder, and note which of them run which line."""
    from coverage import Coverage

    settings = folder / "coveragerc"
    settings.write_text(_SETTINGS.format(folder=folder, tree=project))
    packages = sorted({file.parent for file in (project / "tests").rglob("test_*.py")})
    for package in packages:
        name = "-".join(package.relative_to(project).parts)
        env = beside_python() | {
            "COVERAGE_PROCESS_START": str(settings),
            "HYPOTHESIS_PROFILE": "ci",
            "TEGA_TOOK": str(folder / f"took-{name}.json"),
        }
        command = ["coverage", "run", f"--rcfile={settings}", "-m", "pytest", "-n0", "-q"]
        more = ["-p", "tega_campaigns.mutants.covered", str(package)]
        subprocess.run([*command, *more], cwd=project, env=python_environment(env), check=False)
    found = Coverage(data_file=str(folder / "covered"), config_file=False)
    found.combine()
    found.save()


def copied(project: Path, tree: Path) -> Path:
    """Return a copy of the last commit, with the built extension."""
    if not tree.exists():
        subprocess.run(["git", "clone", "--quiet", str(project), str(tree)], check=True)
    for built in (project / "python" / "tega").glob("_native*.so"):
        shutil.copy2(built, tree / "python" / "tega")
    return tree


def table(folder: Path) -> str:
    """Return the results as a table, and what survived."""
    from scipy.stats import binomtest

    rows = ["| language | tried | killed | share | 95 % interval |", "|---|---|---|---|---|"]
    left: list[str] = []
    for language in ("rust", "python"):
        trials = [one for one in kept(folder, language) if one.outcome != "unviable"]
        if not trials:
            continue
        killed = sum(one.outcome == "killed" for one in trials)
        interval = binomtest(killed, len(trials)).proportion_ci(method="wilson")
        share = f"{100 * killed / len(trials):.0f} %"
        span = f"{100 * interval.low:.0f} to {100 * interval.high:.0f} %"
        rows.append(f"| {language} | {len(trials)} | {killed} | {share} | {span} |")
        left += [f"- `{one.name}`: {one.outcome}" for one in trials if one.outcome != "killed"]
    return "\n".join([*rows, "", *left])


def main() -> None:
    """Run a step of the campaign."""
    parser = argparse.ArgumentParser(prog="python -m tega_campaigns.mutants", description=__doc__)
    parser.add_argument("step", choices=["cover", "python", "rust", "table"])
    parser.add_argument("--n", type=int, default=100, help="number of changes to try")
    parser.add_argument("--seed", type=int, default=1, help="seed of the draw")
    parser.add_argument("--out", type=Path, default=Path("target/mutants"), help="folder of what is kept")
    given = parser.parse_args()
    project, folder = Path.cwd(), given.out.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if given.step == "cover":
        cover(project, folder)
    elif given.step == "table":
        sys.stdout.write(table(folder) + "\n")
    else:
        _try(given.step, project, folder, given.n, given.seed)


def _try(language: str, project: Path, folder: Path, wanted: int, seed: int) -> None:
    tree = copied(project, folder / f"tree-{language}")
    keep, done = progress(folder, language, wanted), {one.name for one in kept(folder, language)}
    covered = Covered.read(folder) if language == "python" else None
    baselines_s: dict[str, float] = {}
    for mutant in (python_mutants if covered else rust_mutants)(tree, seed):
        if mutant.name in done:
            continue
        trial = try_python(mutant, tree, covered, project) if covered else try_rust(mutant, tree, baselines_s)
        if keep(trial):
            return


if __name__ == "__main__":
    main()
