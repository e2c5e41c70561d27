"""Check names that come from outside before they become part of a path.

A recording, a study's folder, a plan or a message can hold any text where a name is expected: ``/etc/passwd``,
``../../.ssh/authorized_keys``, ``C:x``. Every such text goes through :func:`plain_name` before it becomes the name of a
file or folder.
"""

from __future__ import annotations

import re
from pathlib import Path

from tega.errors import UnsafeNameError

LONGEST_NAME = 128
"""Characters that a name may have, of the 255 bytes that file systems take: endings are added to it."""

_PLAIN = re.compile(rf"[A-Za-z0-9_][A-Za-z0-9._+-]{{0,{LONGEST_NAME - 1}}}")
# Windows opens a device under these names, whatever ending they have.
_DEVICES = re.compile(r"(CON|PRN|AUX|NUL|COM[0-9]|LPT[0-9])(\..*)?", re.IGNORECASE)


def plain_name(name: str, *, subject: str, source: str) -> str:
    """Return a name from outside, which can only name something inside the folder that it is joined to.

    Args:
        name: The name: 1 to 128 ASCII letters, digits, dots, dashes, underscores and pluses, not a dot or a dash in
            front, not a dot at the end, and none of Windows' device names.
        subject: Kind of thing that it names, such as ``attachment``.
        source: The file or message that it stands in.

    Raises:
        UnsafeNameError: It is not such a name.

    Example:
        >>> plain_name("baseline-thumb.npy", subject="attachment", source="trial-001.mcap")
        'baseline-thumb.npy'
    """
    if not _PLAIN.fullmatch(name) or name.endswith(".") or _DEVICES.fullmatch(name):
        displayed = repr(name if len(name) <= LONGEST_NAME else name[:LONGEST_NAME] + "…")
        raise UnsafeNameError(
            f"{source}: {subject} {displayed} cannot be the name of a file",
            f"nothing was written there; a name has 1 to {LONGEST_NAME} letters a to z, digits, '.', '-', '_', '+'",
        )
    return name


def path_below(folder: Path, name: str, *, subject: str, source: str) -> Path:
    """Return the path of something below a folder, from a name such as ``gels/D20982/before.png``.

    Each part has to be a name as for :func:`plain_name`, else the path might lie outside of the folder.
    """
    return folder.joinpath(*(plain_name(part, subject=subject, source=source) for part in name.split("/")))
