"""Judge how a vest is worn or driven, by where a person says that its columns are felt."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from tega.haptics import Layout
from tega.haptics.motor_layout import SHIPPED, Face, find_layout


def column_sites(layout: Layout) -> tuple[str, ...]:
    """Return the columns of a layout that have motors: front, then back, each from the wearer's left.

    Example:
        >>> column_sites("x16")
        ('f1', 'f2', 'f3', 'f4', 'b1', 'b2', 'b3', 'b4')
    """
    columns = {(motor.face != "front", motor.column + 1) for motor in find_layout(layout).motors}
    return tuple(f"{'fb'[back]}{column}" for back, column in sorted(columns))


def site_motors(site: str, layout: Layout) -> tuple[int, ...]:
    """Return the motors of a site by number: a column such as ``f1``, or one motor such as ``m23``.

    The layouts that come with TEGA are parts of the vest of 40 motors, and have its columns.

    Example:
        >>> site_motors("b2", "x16")
        (21, 25, 29, 33, 37)
    """
    if site.startswith("m"):
        return (int(site[1:]),)
    motors = find_layout("x40" if layout in SHIPPED else layout).motors
    return tuple(m.number for m in motors if f"{m.face[0]}{m.column + 1}" == site)


def site_place(site: str, layout: Layout) -> str:
    """Say where a site is felt.

    Example:
        >>> site_place("b2", "x40"), site_place("m23", "x40")
        ('back, column 2 of 4 from your left', 'back, row 1, column 4 of 4 from your left')
    """
    table, number = find_layout(layout), site_motors(site, layout)[0]
    (motor,) = (motor for motor in table.motors if motor.number == number)
    row = f"row {motor.row + 1}, " * site.startswith("m")
    return f"{motor.face}, {row}column {motor.column + 1} of {table.columns(motor.face)} from your left"


def site_face(site: str, layout: Layout) -> str:
    """Return the face of a site, ``f`` or ``b``."""
    return site_place(site, layout)[0]


def middle_sites(levels: Mapping[str, int], layout: Layout) -> tuple[str, ...]:
    """Return the site of each face that is felt as most are there: the one with the middle threshold.

    ``levels`` are the threshold levels by site, 0 where nothing is felt.

    Example:
        >>> middle_sites({"f1": 2, "f2": 3, "f3": 5, "b1": 0}, "x40")
        ('f2',)
    """
    chosen = []
    for face in "fb":
        mine = {site: level for site, level in levels.items() if level and site_face(site, layout) == face}
        felt = sorted((level, site) for site, level in mine.items())
        if felt:
            chosen.append(felt[len(felt) // 2][1])
    return tuple(chosen)


class Wearing(msgspec.Struct, frozen=True, kw_only=True):
    """Places named right and places shown; ``notes`` are the problems found, once kept those that stayed."""

    n_right: int
    n_asked: int
    notes: tuple[str, ...] = ()


def judge_wearing(answers: Mapping[str, str], layout: Layout) -> Wearing:
    """Judge a person's answers: by the column shown, the column named, or ``"n"`` for nothing felt.

    Neighbouring columns are easily confused; a mirrored face or swapped faces are not, and are reported.
    """
    felt = {displayed: text for displayed, text in answers.items() if text in answers}
    problems = []
    unfelt = [displayed for displayed in answers if displayed not in felt]
    if unfelt:
        places = "; ".join(site_place(site, layout) for site in unfelt)
        problems.append(f"not felt at all: {places}: tighten the vest, or a motor is dead")
    if felt and sum(text[0] != displayed[0] for displayed, text in felt.items()) > len(felt) / 2:
        problems.append("front and back are felt exchanged: is the vest on the right way round?")
    mirrored = []
    faces: tuple[Face, ...] = ("front", "back")
    for name in faces:
        side = name[0]
        own = [(int(s[1:]), int(a[1:])) for s, a in felt.items() if s[0] == side and a[0] == side]
        as_is = sum(abs(displayed - text) for displayed, text in own)
        turned = sum(abs(1 + find_layout(layout).columns(name) - displayed - text) for displayed, text in own)
        if len(own) >= 3 and turned < as_is and as_is >= len(own):
            mirrored.append(name)
    if mirrored:
        subject = 'set vest.mirror = "all"'
        if len(mirrored) == 1:
            subject = {
                "front": "over Bluetooth set vest.options.front_mirror = true",
                "back": 'set vest.mirror = "back"',
            }[mirrored[0]]
        problems.append(f"{' and '.join(mirrored)} felt mirrored: {subject}")
    n_right = sum(displayed == text for displayed, text in answers.items())
    return Wearing(n_right=n_right, n_asked=len(answers), notes=tuple(problems))
