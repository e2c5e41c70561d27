"""Field numbers of the records' messages by version, as files of every version have them.

``tests/golden/record-fields.json`` holds them. After a change of a record::

    python tools/figures/tega_figures/record_fields.py --update
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path

import msgspec

import tega
from tega.recording.mcap_schemas import record_messages
from tega.records import RECORDS
from tega.records.schema import Part, fields, parts, schema_name
from tega.runtime.features import having, load_target

FILE = Path(__file__).parents[3] / "tests" / "golden" / "record-fields.json"

Fields = list[str]
"""Type and name of each field; the first has number 1."""
Table = dict[str, dict[str, Fields]]
"""Of each message, its fields by its version."""


def fields_now(kind: Part) -> Fields:
    """Return the fields of a record as its message has them now."""
    return [
        f"{'repeated ' * one.repeated}{'optional ' * one.optional}{one.wire} {one.name}"
        for one in fields(kind)
    ]


def own_messages() -> dict[str, Part]:
    """Return the messages of TEGA's own distribution, without those of other installed features."""
    own = [load_target(feature.records, feature, tuple) for feature in having("records") if feature.own]
    names = {
        schema_name(part) for kinds in (RECORDS, *own) for kind in kinds for part in (kind, *parts(kind))
    }
    return {name: kind for name, kind in record_messages().items() if name in names}


def problems(table: Table, messages: Mapping[str, Part]) -> list[str]:
    """Return what is wrong with the records as they are now: a sentence each."""
    found = []
    for name, kind in messages.items():
        version, now, known = getattr(kind, "version", 1), fields_now(kind), table.get(name, {})
        earlier = [known[number] for number in sorted(known, key=int) if int(number) < version]
        if any(int(number) > version for number in known):
            found.append(f"{name}: version {version} is before one that files have")
        if earlier and now[: len(earlier[-1])] != earlier[-1]:
            found.append(f"{name}: a field of an earlier version has another number: new ones go to the end")
        if earlier and (bare := _required(kind, now[len(earlier[0]) :])):
            found.append(f"{name}: {bare} has no default, and earlier files do not hold it")
        if known.get(str(version), now) != now:
            found.append(f"{name}: its fields are not those of version {version}: raise the version")
    return found


def _required(kind: Part, added: Fields) -> str:
    """Return the first of some fields without a default."""
    names = {line.rpartition(" ")[2] for line in added}
    without = [msgspec.NODEFAULT] * (len(kind.__struct_fields__) - len(kind.__struct_defaults__))
    defaults = zip(kind.__struct_encode_fields__, (*without, *kind.__struct_defaults__), strict=True)
    return next((name for name, one in defaults if one is msgspec.NODEFAULT and name in names), "")


def update() -> None:
    """Add the versions that the table does not have yet.

    Raises:
        SystemExit: A record is not as an earlier file needs it.
    """
    table: Table = json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
    messages = own_messages()
    if found := problems(table, messages):
        raise SystemExit("\n".join(found))
    for name, kind in messages.items():
        versions, version = table.setdefault(name, {}), str(getattr(kind, "version", 1))
        if version not in versions:
            print(f"{name}: version {version} added")  # this is a program
        versions[version] = fields_now(kind)
    text = json.dumps(dict(sorted(table.items())), indent=1, ensure_ascii=False)
    FILE.write_text(f"{text}\n", encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:] != ["--update"]:
        raise SystemExit(__doc__)
    read, edited = Path(tega.__file__).resolve().parent, FILE.resolve().parents[2] / "python" / "tega"
    if read != edited:
        raise SystemExit(f"tega is read from {read}, not from {edited}: install that one, with make setup")
    update()
