"""Read where printed tags stand on table, hand and object: the tag layout, a TOML file.

::

    family = "apriltag-36h11"

    [table]
    tags = [{id = 0, size_mm = 50, at_mm = [-200, 0, 0], x = [1, 0, 0], y = [0, 1, 0]}]

    [object]
    base_mm = 82                        # diameter of the object's base; its middle is the origin
    grip_mm = 110                       # height over the base at which the hand holds it
    cube = {first = 10, edge_mm = 50, tag_mm = 38, at_mm = [0, 0, 285]}

    [hand]
    cube = {first = 20, edge_mm = 50, tag_mm = 38, at_mm = [0, 0, 0]}

Each table is a rigid body with axes of its own, millimetres; those of ``[table]`` have z up and the marked place as
origin. A tag has the side length of its black square, its middle, and the directions of its right and upper side. A
``cube`` stands for the five tags of a box with open bottom, numbered from ``first``: top, +x, -x, +y, -y. A tag with
``slides`` moves along that direction with the object's width: half a millimetre for each millimetre that the object is
wider than when it stood untouched.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import Annotated, Final, Literal

import msgspec
import numpy as np
import tomlkit
from numpy.typing import NDArray

from tega.config.errors import wrong_value
from tega.errors import ConfigError
from tega.runtime.files.foreign_file import parse_toml, read_words
from tega.runtime.files.toml_text import tree_item
from tega.runtime.files.whole_file import write_whole

Family = Literal["apriltag-36h11", "apriltag-25h9", "apriltag-16h5", "aruco-4x4-50", "aruco-5x5-100"]

_Millimetres = Annotated[float, msgspec.Meta(ge=-5000, le=5000)]
_Vector = tuple[_Millimetres, _Millimetres, _Millimetres]
_Id = Annotated[int, msgspec.Meta(ge=0, le=586)]
_Size = Annotated[float, msgspec.Meta(ge=5, le=500)]

_SIDES: Final[tuple[tuple[_Vector, _Vector], ...]] = (
    ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
)
"""Right and upper side of a cube's tags: top, +x, -x, +y, -y."""


class PlacedTag(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One tag on a body.

    Attributes:
        size_mm: Side of its black square.
        at_mm: Its middle, in the body's axes.
        x: Direction of its right side.
        y: Direction of its upper side, at right angles to that.
        slides: Direction in which it moves as the object gets wider; zeros where it stays.
    """

    id: _Id
    size_mm: _Size
    at_mm: _Vector
    x: _Vector = (1.0, 0.0, 0.0)
    y: _Vector = (0.0, 1.0, 0.0)
    slides: _Vector = (0.0, 0.0, 0.0)

    def corners_m(self) -> NDArray[np.float64]:
        """Return upper left, upper right, lower right, lower left, float64 (4, 3), metres, in the body's axes."""
        x, y = np.array(self.x), np.array(self.y)
        half = self.size_mm / 2
        return (np.array(self.at_mm) + half * np.array([y - x, y + x, x - y, -x - y])) / 1000


class TagCube(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A box with a tag on each side but its bottom.

    Attributes:
        first: Number of the top's tag; the others follow.
        tag_mm: Side of a tag's black square.
        at_mm: Middle of the box, in the body's axes.
    """

    first: _Id
    edge_mm: _Size
    tag_mm: _Size
    at_mm: _Vector = (0.0, 0.0, 0.0)

    def tags(self) -> list[PlacedTag]:
        """Return the five tags."""
        found = []
        for number, (x, y) in enumerate(_SIDES):
            a, b, c = (np.cross(x, y) * self.edge_mm / 2 + np.array(self.at_mm)).tolist()
            found.append(PlacedTag(self.first + number, self.tag_mm, (a, b, c), x, y))
        return found


class TagBody(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A rigid body that carries tags.

    Attributes:
        cube: A box of five, where it has one.
        base_mm: Diameter of its flat base about the origin; 0 where it does not stand.
        grip_mm: Height over the base at which the hand holds it: what moves there against the palm is slip.
    """

    tags: tuple[PlacedTag, ...] = ()
    cube: TagCube | None = None
    base_mm: Annotated[float, msgspec.Meta(ge=0, le=2000)] = 0.0
    grip_mm: Annotated[float, msgspec.Meta(ge=0, le=2000)] = 0.0

    def all_tags(self) -> list[PlacedTag]:
        """Return the single tags and those of the cube."""
        return [*self.tags, *(self.cube.tags() if self.cube else [])]


class TagLayout(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Layout of printed tags on table, object and hand.

    The table's tags lie on it, and determine where up is; the hand's are on whatever moves with its palm.
    """

    table: TagBody
    object: TagBody
    hand: TagBody = TagBody()
    family: Family = "apriltag-36h11"

    def bodies(self) -> Mapping[str, TagBody]:
        """Return the bodies by name."""
        return {"table": self.table, "object": self.object, "hand": self.hand}


def load_layout(file: Path) -> TagLayout:
    """Read a tag layout.

    A value out of range, a tag's sides not at right angles, or a number that is given twice, raise
    :class:`ConfigError`.
    """
    try:
        tree = parse_toml(read_words(file, error=ConfigError))
        layout = msgspec.convert(tree, TagLayout)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(
            f"{file.name}: the tag layout cannot be read: {error}",
            "tega-teleop scene tags --layout writes one",
        ) from error
    except msgspec.ValidationError as error:
        raise ConfigError(
            f"{file.name}: {wrong_value(error, tree)}", "tega-teleop scene tags --layout writes a good one"
        ) from error
    check_layout(layout, file.name)
    return layout


def save_layout(file: Path, layout: TagLayout) -> None:
    """Write a tag layout."""
    text = tomlkit.document()
    text.add(tomlkit.comment("Where printed tags are; millimetres, in the axes of each body."))
    text.add("family", tomlkit.item(layout.family))
    usual = msgspec.to_builtins(PlacedTag(0, 10.0, (0.0, 0.0, 0.0)))
    for name, body in layout.bodies().items():
        given = msgspec.to_builtins(body)
        tags = [
            {k: v for k, v in tag.items() if k in {"id", "size_mm", "at_mm"} or v != usual[k]}
            for tag in given.pop("tags")
        ]
        table = {
            "base_mm": given["base_mm"],
            "grip_mm": given["grip_mm"],
            "cube": given["cube"],
            "tags": tags,
        }
        text.add(name, tree_item({key: value for key, value in table.items() if value}))
    write_whole(file, tomlkit.dumps(text))


def check_layout(layout: TagLayout, name: str) -> None:
    """Refuse a layout that no sheet of paper can be; raises as :func:`load_layout`."""
    tags = list(chain.from_iterable(body.all_tags() for body in layout.bodies().values()))
    for tag in tags:
        gram = np.array([tag.x, tag.y]) @ np.array([tag.x, tag.y]).T
        if not np.allclose(gram, np.eye(2), atol=1e-3):
            raise ConfigError(
                f"{name}: tag {tag.id}: x = {tag.x} and y = {tag.y} are not two directions of length 1 at right angles"
            )
        length = float(np.linalg.norm(tag.slides))
        if length and abs(length - 1) > 1e-3:
            raise ConfigError(f"{name}: tag {tag.id}: slides = {tag.slides} has length {length:.3g}, not 1")
    numbers = [tag.id for tag in tags]
    twice = sorted({number for number in numbers if numbers.count(number) > 1})
    if twice:
        raise ConfigError(
            f"{name}: tag {twice[0]} is there twice", "each printed tag has a number of its own"
        )
    for body in ("table", "object"):
        if not layout.bodies()[body].all_tags():
            raise ConfigError(f"{name}: [{body}] has no tags", "give it tags or a cube")


def example_layout(*, height_mm: float = 260.0, base_mm: float = 82.0) -> TagLayout:
    """Return the layout that the sheets of ``tega-teleop scene tags`` are for.

    Four tags of 50 mm are on the table about the marked place, all on one sheet. A box of 50 mm with tags of
    38 mm is on a post of 15 mm on the object, and one on the hand. Two tags of 25 mm on the object's wall, to
    both sides as the camera sees it, measure its width. The camera looks from between +x and +y and from
    above, so that it sees three sides of each box. The object is held half way up its height; ``base_mm`` is
    its base's diameter.
    """
    corners = [(-105.0, 65.0, 0.0), (105.0, 65.0, 0.0), (-105.0, -65.0, 0.0), (105.0, -65.0, 0.0)]
    width_mm = base_mm + 80
    root = math.sqrt(0.5)
    wall = [
        PlacedTag(
            8 + number,
            25.0,
            (-side * root * width_mm / 2, side * root * width_mm / 2, 20.0),
            (-root, root, 0.0),
            (0.0, 0.0, 1.0),
            (-side * root, side * root, 0.0),
        )
        for number, side in enumerate((-1, 1))
    ]
    return TagLayout(
        table=TagBody(tags=tuple(PlacedTag(number, 50.0, at) for number, at in enumerate(corners))),
        object=TagBody(
            tags=tuple(wall),
            cube=TagCube(10, 50.0, 38.0, (0.0, 0.0, height_mm + 40)),
            base_mm=base_mm,
            grip_mm=height_mm / 2,
        ),
        hand=TagBody(cube=TagCube(20, 50.0, 38.0)),
    )
