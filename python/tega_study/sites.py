"""Average the sessions of several sites, each in a bundle, as one Table I: every site for itself, and all together."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec

from tega.errors import InvalidValueError, RecordingError
from tega_study.bundle import OpenedBundle, open_bundle
from tega_study.difference import cells_of
from tega_study.journal import events_path, read_events
from tega_study.plan import StudyPlan, read_plan
from tega_study.state import derive
from tega_study.tables import table_of
from tega_study.trials import Trial


class Site(NamedTuple):
    """One site: everyone who took part under one plan.

    Attributes:
        name: Its number in the order of the bundles, such as ``site 1``.
        complete: People whose session is here and has no trial left.
        rehearsed: Whether these are no data of persons.
        trials: With ids that differ between sites.
    """

    name: str
    plan_sha256: str
    planned: int
    complete: int
    rehearsed: bool
    trials: tuple[Trial, ...]


class SitesTable(NamedTuple):
    """Table I over sites.

    Rows: a head, then each site, condition and metric; those of ``all`` last, if there are several.
    """

    sites: tuple[Site, ...]
    rows: list[list[str]]

    @property
    def interim(self) -> bool:
        """Whether any plan is not complete."""
        return any(site.complete < site.planned for site in self.sites)


class _Session(NamedTuple):
    opened: OpenedBundle
    plan: StudyPlan
    complete: bool


def sites_table(bundles: Sequence[Path], *, unblind: bool = False) -> SitesTable:
    """Check every hash of the bundles, work their trials out again, and average them.

    Bundles of one plan are one site. ``unblind`` compares conditions although the plan of a site is not
    complete, otherwise a ``RecordingError``. ``InvalidValueError`` if a session is given twice, sites differ
    in objects or conditions, or rehearsals are mixed with sessions of persons.
    """
    by_plan: dict[str, dict[str, _Session]] = {}
    for bundle in bundles:
        session = _opened(bundle)
        manifest = session.opened.manifest
        people = by_plan.setdefault(manifest.plan_sha256, {})
        if manifest.participant in people:
            raise InvalidValueError(
                f"{bundle.name}: {manifest.participant} of this plan is given twice", "give each session once"
            )
        people[manifest.participant] = session
    plans = [next(iter(people.values())).plan.settings for people in by_plan.values()]
    for plan in plans:
        if (set(plan.objects), set(plan.conditions)) != (set(plans[0].objects), set(plans[0].conditions)):
            raise InvalidValueError(
                f"sites differ: {', '.join(plans[0].objects)} under {', '.join(plans[0].conditions)}, and "
                f"{', '.join(plan.objects)} under {', '.join(plan.conditions)}",
                "make a table for each",
            )
    sites = tuple(_site(f"site {n}", key, people) for n, (key, people) in enumerate(by_plan.items(), 1))
    if len({site.rehearsed for site in sites}) > 1:
        names = ", ".join(site.name for site in sites if site.rehearsed)
        raise InvalidValueError(f"{names}: rehearsed, no data of persons", "make a table for each kind")
    for site in sites:
        if site.complete < site.planned and not unblind:
            raise RecordingError(
                f"{site.name}: {site.complete} of {site.planned} people of its plan are complete and here",
                "give the other bundles; --unblind compares conditions before that, which costs the test its level",
            )
    groups = [(site.name, site.trials) for site in sites]
    if len(sites) > 1:
        groups.append(("all", tuple(trial for site in sites for trial in site.trials)))
    return SitesTable(sites, _rows(groups, plans[0].objects, plans[0].conditions))


def _opened(bundle: Path) -> _Session:
    """Open a bundle for a moment."""
    with tempfile.TemporaryDirectory(prefix="tega-site-") as name:
        folder = Path(name) / "session"
        opened = open_bundle(bundle, folder)
        plan, person = read_plan(folder), opened.manifest.participant
        state = derive(plan.of(person), read_events(events_path(folder, person)))
    return _Session(opened, plan, state.next is None)


def _site(name: str, plan_sha256: str, people: dict[str, _Session]) -> Site:
    kinds = {one.opened.manifest.rehearsed for one in people.values()}
    if len(kinds) > 1:
        raise InvalidValueError(
            f"{name}: some of its sessions are rehearsed, no data of persons", "leave them out"
        )
    trials = [
        msgspec.structs.replace(trial, id=f"{name}: {trial.id}", participant=f"{name}: {trial.participant}")
        for one in people.values()
        for trial in one.opened.trials
    ]
    planned = len(next(iter(people.values())).plan.participants)
    complete = sum(one.complete for one in people.values())
    return Site(name, plan_sha256, planned, complete, kinds.pop(), tuple(trials))


def _rows(
    groups: Sequence[tuple[str, Sequence[Trial]]], objects: Sequence[str], conditions: Sequence[str]
) -> list[list[str]]:
    rows: list[list[str]] = []
    for name, trials in groups:
        head, *lines = table_of(cells_of(trials, objects, conditions), objects, conditions)
        people = str(len({trial.participant for trial in trials}))
        rows = rows or [["Site", "People", *head]]
        rows += [[name, people, *line] for line in lines]
    return rows
