"""Define the options and habits that verbs share: --json, Ctrl-C, progress, the pip line that works here."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Final, TypeVar
from urllib.parse import urlsplit

import click

from tega.runtime.words import number_text
from tega.safety.stop import Stop as AnyStop

_Function = TypeVar("_Function", bound=Callable[..., Any])

PATH: Final = click.Path(path_type=Path)
FILE: Final = click.Path(path_type=Path, dir_okay=False)


class CommaList(click.ParamType[list[Any]]):
    """Values, comma separated: ``read`` makes them of the parts or raises ``ValueError``, ``wanted`` says of what."""

    def __init__(self, name: str, wanted: str, read: Callable[[list[str]], list[Any]]) -> None:
        self.name, self._wanted, self._read = name, wanted, read

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> list[Any]:
        """Read the values, or fail with a usage error."""
        if isinstance(value, list):
            return value
        try:
            return self._read(str(value).split(","))
        except ValueError:
            self.fail(f"{value!r} is not a list of {self._wanted}", param, ctx)


def _channels(parts: list[str]) -> list[int]:
    channels = list(map(int, parts))
    if min(channels) < 1:
        raise ValueError
    return channels


def _names(parts: list[str]) -> list[str]:
    names = dict.fromkeys(part.strip() for part in parts)
    if "" in names:
        raise ValueError
    return list(names)


CHANNELS: Final = CommaList("n,n,...", "channel numbers from 1, such as 3,6,8", _channels)
NAMES: Final = CommaList("name,name,...", "names, such as bottle,bag", _names)
NUMBERS: Final = CommaList(
    "number,...", "numbers, such as 0.3,0.6", lambda parts: list(dict.fromkeys(map(float, parts)))
)


class FiniteRange(click.FloatRange):
    """Number within a range; click takes ``nan`` for one in every range, and ``inf`` where an end is open."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number, or fail with a usage error."""
        number: float = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


class PngPath(click.Path):
    """PNG file to write, in a folder that is made now: after the work would be too late to refuse it."""

    def __init__(self) -> None:
        super().__init__(dir_okay=False, path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path, or fail with a usage error if it is no PNG, or in no folder to write to."""
        path = Path(str(super().convert(value, param, ctx)))
        if path.suffix.lower() != ".png":
            self.fail(
                f"{path}: pictures are written as PNG; name it {path.with_suffix('.png').name}", param, ctx
            )
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            TemporaryFile(dir=path.parent).close()
        except OSError as error:
            self.fail(f"{path}: nothing can be written in its folder: {error.strerror}", param, ctx)
        return path


def all_options(*options: Callable[[Any], Any]) -> Callable[[_Function], _Function]:
    """Return a decorator that adds options, which the help then lists in this order."""

    def add(function: _Function) -> _Function:
        for option in reversed(options):
            function = option(function)
        return function

    return add


json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON on stdout.")
sets_option = click.option(
    "--set",
    "sets",
    multiple=True,
    metavar="KEY=VALUE",
    help="Override a setting, such as session.preset=paper; repeatable.",
)
preset_option = click.option(
    "--preset",
    type=click.Choice(["paper", "live"]),
    default="live",
    show_default=True,
    help="Readings of the equations: paper (as printed) or live (meant for people).",
)
picture_option = click.option(
    "--picture",
    type=PngPath(),
    help="PNG to draw: each finger's firmest contact, then touch, level, fingers and vest over time.",
)


def person_option(help_text: str) -> Callable[[_Function], _Function]:
    """Return the option that names a participant, with what it is for."""
    return click.option("--person", metavar="ID", help=help_text)


worn_option: Final = person_option(
    "Person who wears the vest; it stays within the rest of that person's daily vibration."
)
calibrated_person_option = click.option(
    "--person", required=True, metavar="ID", help="Whose calibration: a code such as p01, not a name."
)
yes_option = click.option(
    "--yes", is_flag=True, help="Go on by the clock instead of waiting for Enter, and ask nothing."
)
time_scale_option = click.option(
    "--time-scale", type=FiniteRange(0.05, 4), default=1.0, metavar="FACTOR",
    help="Scale all durations by FACTOR (for rehearsals).",
)  # fmt: skip


def echo_json(value: Any) -> None:
    """Print a value as JSON on stdout; numbers that JSON does not have, NaN and infinity, are ``null``.

    Example:
        >>> echo_json([float("nan")])
        [
          null
        ]
    """
    # ASCII: valid in whatever encoding the output has, and for names of files that are no UTF-8.
    click.echo(json.dumps(json.loads(json.dumps(value), parse_constant=lambda _: None), indent=2))


def answer(value: Any, lines: Iterable[object], *, as_json: bool) -> None:
    """Print what a verb found: a value as JSON, or lines."""
    if as_json:
        echo_json(value)
    else:
        for line in lines:
            click.echo(line)


def value_text(value: object) -> str:
    """Return a value of a setting in words."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(value_text, value))}]"
    if value is None:
        return "not set"
    if isinstance(value, float):
        return number_text(value, 12)
    return str(value).lower() if isinstance(value, bool) else str(value)


def worn_by(person: str | None, sets: tuple[str, ...]) -> tuple[str, ...]:
    """Return overrides of settings, with the person added if there is one."""
    return sets if person is None else (*sets, f"calibration.person={json.dumps(person)}")


@contextmanager
def stop_keys(stop: AnyStop, *, others: Mapping[str, Callable[[], None]] = {}) -> Iterator[None]:
    """Let the space bar and q ask for the end where a terminal sends keys, wherever the output goes."""
    if not sys.stdin.isatty():
        yield
        return
    from tega.runtime.keys import Keys

    def pressed() -> str:
        for key in keys.read():
            if key in {" ", "q", "Q"}:
                return "the space bar" if key == " " else "the key q"
            if (action := others.get(key)) is not None:
                action()
        return ""

    with Keys() as keys:
        stop.also(pressed)
        yield


@contextmanager
def progress_bar(*, enabled: bool = True) -> Iterator[Callable[[str, int, int], None]]:
    """Show how long work goes on, on a terminal's stderr only."""
    if not enabled or not sys.stderr.isatty():
        yield lambda _subject, _done, _total: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task, last = bar.add_task("preparing", total=None), ("", 0)

        def show(subject: str, done: int, total: int) -> None:
            nonlocal last
            if last[1] and last[0] != subject:  # full before the next work takes its place
                bar.update(task, completed=last[1], refresh=True)
            last = subject, total
            if total == 0:
                bar.reset(task, description=subject, total=None)
            elif total <= 1000 or done % 16 == 0 or done == total:
                bar.update(task, description=subject, completed=done, total=total, refresh=done == total)

        yield show
        if last[1]:
            bar.update(task, completed=last[1], refresh=True)


def with_origin(text: str, installed: Distribution | None = None) -> str:
    """Put the place that TEGA was installed from into ``pip install 'tega[…]'`` and ``pip install './tools/…'``."""
    if "pip install 'tega[" not in text and "'./tools/" not in text:
        return text
    try:
        message = (installed or distribution("tega")).read_text("direct_url.json")
        address = urlsplit(json.loads(message or "{}").get("url", ""))
    except (PackageNotFoundError, ValueError):
        return text
    if address.scheme != "file":
        return text
    from urllib.request import url2pathname

    place = url2pathname(address.path)
    if Path(place, "tools").is_dir():
        text = text.replace("'./tools/", f"'{place}/tools/")
    return re.sub(r"pip install 'tega(\[[^']*)'", lambda m: f"pip install '{place}{m[1]}'", text)
