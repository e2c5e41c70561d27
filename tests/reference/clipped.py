"""A study whose recorded trials are over, to make clips of."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from reference.sessions import rewritten
from tega_study.detecting import DETECTOR, detected_path
from tega_study.journal import Journal
from tega_study.plan import StudyPlan, make_plan, read_plan, write_plan
from tega_study.state import resume

S, MS = 1_000_000_000, 1_000_000
FIRST_NS, LEAD_NS, LENGTH_NS = 1000 * S, 100 * MS, 1300 * MS
PEOPLE = ("p01", "p02")


def planned() -> StudyPlan:
    return make_plan(participants=2, seed=5, objects=["bag"], trials=1, layout="pairs")


def clipped_study(where: Path, plan: StudyPlan, recording: Path, **changes: Any) -> Path:
    """Make a study of two people whose trials are over: a rule's slip at 0.5 s, the detector's at 0.5 and at 0.9 s."""
    write_plan(plan, where)
    plan = read_plan(where)
    for person in PEOPLE:
        with (
            resume(where, plan, person, t_ns=FIRST_NS)[0] as main,
            Journal(detected_path(where, person)) as found,
        ):
            found.add("session_start", t_ns=FIRST_NS, source=DETECTOR, text=plan.settings.plan_sha256)
            for trial in plan.of(person):
                start_ns = FIRST_NS + trial.trial * 100 * S
                n = trial.trial
                begun = main.add("trial_start", t_ns=start_ns, trial=n, source="auto")
                main.add("slip", t_ns=start_ns + 500 * MS, trial=n, source="auto")
                ended = main.add("trial_end", t_ns=start_ns + LENGTH_NS, trial=n, status="done", success=True)
                times_ns = (start_ns + at_ms * MS for at_ms in (500, 900))
                rows = [{"kind": "slip", "t_ns": t_ns, "value": 0.8} for t_ns in times_ns]
                found.add_attempt((begun, ended), DETECTOR, rows)
                kept = where / "recordings" / person / f"{trial.id}-a1"
                kept.mkdir(parents=True)
                facts = {
                    "trial": trial.id,
                    "attempt": 1,
                    "zero_ns": start_ns - LEAD_NS,
                    "started_ns": start_ns,
                }
                (kept / "trial.json").write_text(json.dumps(facts))
                began = {"tega": {"start_ns": str(start_ns - LEAD_NS)}}
                rewritten(recording, kept / "trial-001.mcap", tables=began, **changes)
    return where


def coded(path: Path, change: Any) -> None:
    """Change a project's events as a rater would, and save it."""
    tree = json.loads(path.read_text(encoding="utf-8"))
    for name, observation in tree["observations"].items():
        observation["events"] = change(name, observation["events"])
    path.write_text(json.dumps(tree), encoding="utf-8")
