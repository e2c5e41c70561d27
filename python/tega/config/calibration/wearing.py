"""Judge how a vest is worn or driven, by where a person says that its columns are felt."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

SITES: tuple[str, ...] = tuple(f"{side}{column}" for side in "fb" for column in (1, 2, 3, 4))
"""Columns: front and back, from the wearer's left."""


def site_motors(site: str) -> tuple[int, ...]:
    """Return the motors of a site: a column such as ``f1``, or one motor such as ``m23``.

    Example:
        >>> site_motors("b2")
        (21, 25, 29, 33, 37)
    """
    if site.startswith("m"):
        return (int(site[1:]),)
    first = (20 if site[0] == "b" else 0) + int(site[1]) - 1
    return tuple(range(first, first + 20, 4))


def site_place(site: str) -> str:
    """Say where a site is felt.

    Example:
        >>> site_place("b2"), site_place("m23")
        ('back, column 2 of 4 from your left', 'back, row 1, column 4 of 4 from your left')
    """
    if site.startswith("m"):
        panel, place = divmod(int(site[1:]), 20)
        row, column = divmod(place, 4)
        return f"{('front', 'back')[panel]}, row {row + 1}, column {column + 1} of 4 from your left"
    return f"{'back' if site[0] == 'b' else 'front'}, column {site[1]} of 4 from your left"


def site_face(site: str) -> str:
    """Return the face of a site, ``f`` or ``b``."""
    return "b" if min(site_motors(site)) >= 20 else "f"


def middle_sites(levels: Mapping[str, int]) -> tuple[str, ...]:
    """Return the site of each face that is felt as most are there: the one with the middle threshold.

    ``levels`` are the threshold levels by site, 0 where nothing is felt.

    Example:
        >>> middle_sites({"f1": 2, "f2": 3, "f3": 5, "b1": 0})
        ('f2',)
    """
    chosen = []
    for face in "fb":
        felt = sorted((level, site) for site, level in levels.items() if level and site_face(site) == face)
        if felt:
            chosen.append(felt[len(felt) // 2][1])
    return tuple(chosen)


class Wearing(msgspec.Struct, frozen=True, kw_only=True):
    """Places named right and places shown; ``notes`` are the problems found, once kept those that stayed."""

    n_right: int
    n_asked: int
    notes: tuple[str, ...] = ()


def judge_wearing(answers: Mapping[str, str]) -> Wearing:
    """Judge a person's answers: by the column shown, the column named, or ``"n"`` for nothing felt.

    Neighbouring columns are easily confused; a mirrored face or swapped faces are not, and are reported.
    """
    felt = {displayed: text for displayed, text in answers.items() if text in SITES}
    problems = []
    unfelt = [displayed for displayed in answers if displayed not in felt]
    if unfelt:
        places = "; ".join(map(site_place, unfelt))
        problems.append(f"not felt at all: {places}: tighten the vest, or a motor is dead")
    if felt and sum(text[0] != displayed[0] for displayed, text in felt.items()) > len(felt) / 2:
        problems.append("front and back are felt exchanged: is the vest on the right way round?")
    mirrored = []
    for side, name in (("f", "front"), ("b", "back")):
        own = [(int(s[1]), int(a[1])) for s, a in felt.items() if s[0] == side and a[0] == side]
        as_is = sum(abs(displayed - text) for displayed, text in own)
        turned = sum(abs(5 - displayed - text) for displayed, text in own)
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
