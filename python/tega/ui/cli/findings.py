"""Report the findings of a replay, in words and as a figure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from tega.records.bus import Bus


class Findings:
    """Follows the replay of a recording on its bus, and reports its findings afterwards.

    ``picture`` is the PNG to draw; ``None`` for words alone. If it is ``required`` and matplotlib is not
    installed, ``MissingExtraError`` is raised before the run; else a note at the end reports that.
    """

    def __init__(self, bus: Bus, picture: Path | None, *, required: bool) -> None:
        from tega.errors import MissingExtraError
        from tega.ui.view.course import RunCourse
        from tega.ui.view.session import SessionPicture

        self._course, self._path = RunCourse(bus), picture
        self._picture: SessionPicture | None = None
        self._note = ""
        if picture is not None:
            try:
                self._picture = SessionPicture(bus, self._course)
            except MissingExtraError as error:
                if required:
                    raise
                self._note = f"no picture: {error}"

    def notify(self, title: str, *, pose_base: int, words: bool) -> None:
        """Draw the picture and print the words; the most open level is number ``pose_base``, 0 or 1.

        A failed drawing is reported on stderr, without ``words`` as well.
        """
        if words:
            for sentence in self._course.words(pose_base=pose_base):
                click.echo(f"  {sentence}")
        if self._picture is not None and self._path is not None:
            self._picture.write(self._path, title, pose_base=pose_base)
            if words:
                click.echo(f"  picture: {self._path}")
        if self._note:
            from tega.ui.cli.install_line import with_origin

            click.echo(with_origin(self._note), err=True)
