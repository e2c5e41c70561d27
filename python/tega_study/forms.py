"""Write templates of a consent form and a data protection sheet, filled in from a study's plan."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from tega.errors import InvalidValueError
from tega.runtime.files.whole_file import write_whole
from tega_study.page import report_templates
from tega_study.plan import read_plan

FORMS: Final = ("consent.md", "data-protection.md")


def write_forms(folder: Path, out: Path) -> list[Path]:
    """Write the forms. Values missing from the plan are left in brackets, for the lab to complete.

    None of them may be in ``out`` already: it may have been completed (``InvalidValueError``).
    """
    plan = read_plan(folder)
    settings, first = plan.settings, plan.of(plan.participants[0])
    rests_s = sum(trial.rest_s for trial in first)
    known = {
        "objects": settings.objects,
        "conditions": settings.conditions,
        "participants": settings.participants,
        "trials": len(first),
        "window_s": settings.window_s,
        "rests_min": round(rests_s / 60),
        "total_min": round((rests_s + len(first) * settings.window_s) / 60),
        "probe": settings.probe,
    }
    paths = [out / name for name in FORMS]
    for path in paths:
        if path.exists() or path.is_symlink():
            raise InvalidValueError(f"{path}: is there already", "name another folder with --out")
    made = report_templates().overlay(autoescape=False)
    for path in paths:
        write_whole(path, made.get_template(path.name).render(known) + "\n")
    return paths
