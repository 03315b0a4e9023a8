"""What a scene is made from: fixtures and objects that are wanted, where they start, and where the robot stands.

Records of task declarations, which the scene builder reads.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from robocasa_lerobot.errors import UserError


@dataclass(frozen=True)
class FixtureSpec:
    """A fixture that plays a role in a task.

    Attributes:
        role: name by which the rest of the declaration calls it.
        kind: a word of `kitchens.fixture_types.fixture_filter`, e.g. "drawer_top", "sink", or any appliance.
        near: role of an earlier fixture that it is the nearest to.
        other_than: roles of earlier fixtures that it is none of.
        size: least width and depth of its top, metres; of counters.
        apart_m: least gap on the floor between it and the fixtures of `other_than`, metres.
        middle_apart_m: the same from its middle, metres: a long counter that reaches up to them has room far from them.
        side: of the fixture of `near`, "left" or "right" as seen from before it: it stands in one row with that, and
            reaches beyond it there, as does a counter that the other is let into; any side if empty.
        fitted: with what it is fitted in this task alone, such as "freezer_drawers"; as it is everywhere if empty.
    """

    role: str
    kind: str
    near: str = ""
    other_than: tuple[str, ...] = ()
    size: tuple[float, float] = (0.0, 0.0)
    apart_m: float = 0.0
    middle_apart_m: float = 0.0
    side: str = ""
    fitted: str = ""


@dataclass(frozen=True)
class Choice:
    """A value that is drawn at reset: which knob, which rack, which direction.

    Declarations name it in braces, as in `part="knob_{knob}"`; instructions too.

    Attributes:
        name: of the choice; without an underscore at its start.
        options: by value, the words that instructions may use besides the value itself; of these, those whose name
            begins with an underscore are values for the declaration instead.
        of: role of a fixture whose parts are the options instead: burners, racks, or slots.
        without: start of the names of parts that are no options, such as "rear".
        beginning: start of the parts' names, as "front" of burners; all if empty.
        last: the last of the parts is always taken, as the highest rack.

    Raises:
        UserError: the name begins with an underscore.
    """

    name: str
    options: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    of: str = ""
    without: str = ""
    beginning: str = ""
    last: bool = False

    def __post_init__(self) -> None:
        # An option's word for the choice itself would be such a value too, and replace the one that was drawn.
        if self.name.startswith("_"):
            raise UserError(
                f"choice {self.name!r}: found a name that begins with an underscore, as only further values of a "
                f"choice's options do: its word would replace the value that was drawn. Call it "
                f"{self.name.lstrip('_') or 'part'!r}; instructions need not name it."
            )


@dataclass(frozen=True)
class OnCounter:
    """Start on the counter that carries, or is cut by, the fixture of a role.

    Attributes:
        near: role of the reference fixture.
        loc: "above" centres the region on the fixture; "left_right" puts it directly left or right of it.
        size: width and depth of the region, metres.
        at: "front" or "back" edge of the counter that the region starts from.
        offset: shift of the region to the right and towards the wall, metres.
    """

    near: str
    loc: str = "above"
    size: tuple[float, float] = (1.0, 0.5)
    at: str = "front"
    offset: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class InsideOf:
    """Start inside the fixture of a role.

    Attributes:
        fixture: role.
        size: width and depth of the part of its floor that is used, metres.
        at: where that part lies: -1 at the front, 0 in the middle, 1 at the back.
    """

    fixture: str
    size: tuple[float, float]
    at: float = 0.0


@dataclass(frozen=True)
class SampleRegion:
    """Which part of a fixture's tops or insides is used.

    Attributes:
        ref: role of a reference fixture; none uses the whole fixture. This and `loc` may name a choice in braces.
        loc: with a reference, "nn" takes the part nearest to it, "left" or "right" those on one side, "left_right"
            those on either, "any" all.
        top_size: least width and depth of the part, metres.
        height: bounds of the height in the room of the part's floor, metres.
        level: number of the part from below; -1 is the highest. May name a choice in braces.
        name: start of the part's name, such as "shelf" or "rack0", or a usable shelf of a fridge by its level, as
            "freezer_shelf:highest" (`kitchens.fixtures.regions.region_names`); may name a choice in braces.
    """

    ref: str = ""
    loc: str = "nn"
    top_size: tuple[float, float] = (0.0, 0.0)
    height: tuple[float, float] = (0.0, 3.0)
    level: int | str | None = None
    name: str = ""


@dataclass(frozen=True)
class Placement:
    """Start on or in a fixture, or on an object that was placed before, as RoboCasa's placement records say it.

    Attributes:
        fixture: role; may name a choice in braces.
        object: name of an object of the scene, instead of a fixture; may name a choice in braces.
        region: which part of the fixture.
        size: width and depth of the rectangle that is used, metres; the whole part if None.
        pos: where the rectangle lies, -1 left or front, 1 right or back; "ref" is in line with the reference, None
            anywhere. "{side}" is where the choice `side` (left, right, front, back, middle, or a number) says, and
            "-{side}" opposite to it. Of an object on an object it is not used.
        offset: shift to the right and to the back, metres.
        margin: kept from the rectangle's edges, metres.
        rotation: bounds of the turn, radians.
        other_rotation: other bounds, which are as likely, where there are some.
        try_to_place_in: object group: what can be in a container stands in one of that group, `<name>_container`.
        reuse_region_from: name of an object on whose part of the fixture it starts. Of several alike their own: all
            start on that of the first.
        ensure_inside: the whole footprint lies in the rectangle, not its middle alone.
        slot: it stands along the longer side of the part, and out of its top, as bread does in a toaster.
        lying: on a fixture, it lies on its side: turned by a quarter about its own x axis.
        heaped: on an object, it may lie on what is there already, as low as possible.
    """

    fixture: str = ""
    object: str = ""
    region: SampleRegion = SampleRegion()
    size: tuple[float, float] | None = None
    pos: tuple[float | str | None, float | str | None] = (None, None)
    offset: tuple[float, float] = (0.0, 0.0)
    margin: float = 0.04
    rotation: tuple[float, float] = (-0.7853981633974483, 0.7853981633974483)
    other_rotation: tuple[float, float] | None = None
    try_to_place_in: str = ""
    reuse_region_from: str = ""
    ensure_inside: bool = True
    slot: bool = False
    lying: bool = False
    heaped: bool = False


@dataclass(frozen=True)
class ObjectSpec:
    """An object, or several alike, and where it starts.

    Attributes:
        name: in the scene; several get `<name>_<i>`, from 0 on.
        groups: object groups to draw from; may name a choice in braces.
        start: where.
        count: least and greatest number, both possible; or in braces a choice that is a number, 0 included.
        graspable: whether the gripper must be able to lift it.
        max_height: bound of its size along z, metres.
        properties: further properties asked for, such as "cookable" or "washable".
        exclude: groups or categories that are not wanted.
        max_size: bounds of its size along x, y, z, metres; None leaves an axis free.
        scale: factor of its size, or one for each of x, y, z, before it is turned upright; or in braces a choice that
            is a number.
        scale_step: of several, how much larger each is than the one before.
        upright: turned so that its longest axis points up.
        repeats: may be of a category that the scene already has.
        same_category_as: name of an earlier object whose category it has; of several, their own name makes them alike.
        same_model: with it, the very same model, at its own scale.
        part_of: name of an earlier object whose separate part it is, as the lid of a saucepan: of that one's model and
            scale.
        face_down: turned over; its axes are those of how it lies then.
        stained: red, green and blue of the colour that all of it has instead of its own looks, each 0 to 1.
        filled: the liquid in it, one of `LIQUIDS` in `envs/scene/build.py`; it is there for the eye only.
    """

    name: str
    groups: tuple[str, ...]
    start: OnCounter | InsideOf | Placement
    count: tuple[int, int] | str = (1, 1)
    graspable: bool = False
    max_height: float | None = None
    properties: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    max_size: tuple[float | None, float | None, float | None] | None = None
    scale: float | tuple[float, float, float] | str = 1.0
    scale_step: float = 1.0
    upright: bool = False
    repeats: bool = False
    same_category_as: str = ""
    same_model: bool = False
    part_of: str = ""
    face_down: bool = False
    stained: tuple[float, float, float] | None = None
    filled: str = ""


@dataclass(frozen=True)
class RobotStart:
    """Where the robot stands: facing a fixture, in front of it or beside it.

    Attributes:
        fixture: role; this and `at_object` may name a choice in braces.
        beside: stand half the fixture's width plus the clearance to its left or right, whichever is free.
        clearance: beside it, metres.
        deviation: half ranges of the uniform noise along and towards the counter, metres.
        setback: farther from it than usual, metres.
        at_object: name of an object; it stands in line with the middle of the region in which that is placed, instead
            of the fixture's.
    """

    fixture: str
    beside: bool = False
    clearance: float = 0.2
    deviation: tuple[float, float] = (0.15, 0.05)
    setback: float = 0.0
    at_object: str = ""


@dataclass(frozen=True)
class InitialOpenness:
    """Initial openness of a drawer or of doors, uniform between two shares of full travel.

    Attributes:
        fixture: role.
        low, high: bounds, as shares of full travel.
        part: start of the doors' names, such as the compartment "freezer"; all if empty. The others stay shut.
    """

    fixture: str
    low: float
    high: float
    part: str = ""
