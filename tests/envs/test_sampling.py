"""Where objects may start: parts of fixtures, rectangles in them, containers, and what is said when nothing fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robocasa_lerobot.envs.kitchens.footprints import Footprint, Footprints, PlacementError
from robocasa_lerobot.envs.kitchens.layout import layout_ids, load_layout
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.scene.drawn import PlacedObject
from robocasa_lerobot.envs.scene.placement.objects import place_objects
from robocasa_lerobot.envs.scene.placement.regions import Part, choose_parts, parts_of, rectangle_in
from robocasa_lerobot.envs.scene.robot_poses import faces, is_free, open_doors_of, robot_pose
from robocasa_lerobot.envs.scene.roles import candidates, cast_roles, footprint, ground_fixture
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.registry import get_task

LAYOUT = load_layout(2)
SINK = candidates(LAYOUT, "sink")[0]
COUNTER = next(f for f in candidates(LAYOUT, "counter") if getattr(f, "opening", None) is not None)
CABINET = candidates(LAYOUT, "cabinet_double_door")[0]


def test_a_counter_has_a_part_on_each_side_of_its_sink_and_strips() -> None:
    parts = parts_of(LAYOUT, COUNTER)
    assert len(parts) == 4
    assert sum(part.area.extent for part in parts) == pytest.approx(
        COUNTER.width * COUNTER.depth - SINK.width * SINK.depth, rel=1e-3
    )
    for loc, sign in (("left", -1), ("right", 1)):
        found = choose_parts(LAYOUT, Placement(region=SampleRegion("sink", loc)), COUNTER, SINK, 0.0)
        assert len(found) == 1
        middle = np.array(found[0].area.middle) - SINK.pos[:2]
        assert sign * (middle @ (np.cos(COUNTER.yaw), np.sin(COUNTER.yaw))) > SINK.width / 2 - 1e-6
        assert found[0].area.y1 - found[0].area.y0 == pytest.approx(COUNTER.depth)  # not the strips
    both = choose_parts(LAYOUT, Placement(region=SampleRegion("sink", "left_right")), COUNTER, SINK, 0.0)
    assert len(both) == 2
    with pytest.raises(PlacementError, match="Ask for a smaller part"):
        choose_parts(LAYOUT, Placement(region=SampleRegion(top_size=(9.0, 0.1))), COUNTER, None, 0.0)


def test_positions_are_normalised_and_follow_the_reference() -> None:
    part = max(parts_of(LAYOUT, COUNTER), key=lambda p: p.area.extent)
    start = Placement(size=(0.3, 0.2), pos=(-1.0, 1.0), margin=0.0)
    area = rectangle_in(part, start, COUNTER, None)
    assert (area.x0, area.y1) == pytest.approx((part.area.x0, part.area.y1))
    assert (area.x1 - area.x0, area.y1 - area.y0) == pytest.approx((0.3, 0.2))
    at_ref = rectangle_in(part, replace(start, pos=("ref", -1.0)), COUNTER, SINK)
    assert min(abs(at_ref.x0 - part.area.x0), abs(at_ref.x1 - part.area.x1)) == pytest.approx(0.0)
    assert at_ref.y0 == pytest.approx(part.area.y0)
    inner = rectangle_in(part, replace(start, margin=0.04), COUNTER, None)
    assert inner.x1 - inner.x0 == pytest.approx(0.22)
    with pytest.raises(PlacementError, match="smaller offset"):
        rectangle_in(part, replace(start, offset=(0.0, 5.0)), COUNTER, None)


def test_levels_of_a_cabinet() -> None:
    heights = [part.area.z for part in parts_of(LAYOUT, CABINET)]
    assert heights == sorted(heights)
    top = choose_parts(LAYOUT, Placement(region=SampleRegion(level=-1)), CABINET, None, 0.0)
    assert [part.area.z for part in top] == heights[-1:]
    low = choose_parts(LAYOUT, Placement(region=SampleRegion(height=(1.0, 1.5))), CABINET, None, 0.0)
    assert {part.area.z for part in low} == {z for z in heights if z <= 1.5}


def _task(*objects: ObjectSpec):
    fixtures = (FixtureSpec("sink", "sink"), FixtureSpec("counter", "counter", near="sink"))
    return replace(get_task("PickPlaceCounterToSink"), fixtures=fixtures, objects=objects)


def test_food_stands_in_its_container_and_regions_are_taken_again() -> None:
    start = Placement("counter", region=SampleRegion("sink", "left_right"), try_to_place_in="plate")
    again = Placement("counter", region=SampleRegion("sink", "any"), reuse_region_from="obj")
    task = _task(ObjectSpec("obj", ("fruit",), start), ObjectSpec("other", ("can",), again))
    for seed in range(5):
        rng = np.random.default_rng(seed)
        roles = cast_roles(rng, task.fixtures, LAYOUT)
        assert roles["counter"] == COUNTER.name
        placed = place_objects(rng, task, "target", LAYOUT, roles, {})
        assert set(placed) == {"obj", "obj_container", "other"}
        obj, plate = placed["obj"], placed["obj_container"]
        assert plate.item.category.name == "plate"
        assert np.hypot(obj.pos[0] - plate.pos[0], obj.pos[1] - plate.pos[1]) < max(plate.item.size[:2]) / 2
        assert obj.pos[2] > plate.pos[2]
        parts = parts_of(LAYOUT, COUNTER)
        assert len(parts) > 1
        assert len({_part_under(thing, parts) for thing in placed.values()}) == 1


def _part_under(thing: PlacedObject, parts: list[Part]) -> int:
    """Which part of the counter is nearest to an object's middle."""
    x, y = COUNTER.to_local(thing.pos)
    areas = [part.area for part in parts]
    return min(
        range(len(areas)),
        key=lambda i: max(areas[i].x0 - x, x - areas[i].x1, 0.0) + max(areas[i].y0 - y, y - areas[i].y1, 0.0),
    )


def test_several_alike_stand_on_the_part_of_the_first() -> None:
    """Anywhere on the counter, and all on one side of the sink."""
    start = Placement("counter", size=(0.6, 0.4), pos=(None, -1.0), reuse_region_from="cup")
    task, parts = _task(ObjectSpec("cup", ("cup",), start, count=(3, 3), repeats=True)), parts_of(LAYOUT, COUNTER)
    used = set()
    for seed in range(8):
        rng = np.random.default_rng(seed)
        roles = cast_roles(rng, task.fixtures, LAYOUT)
        try:
            placed = place_objects(rng, task, "target", LAYOUT, roles, {})
        except PlacementError:  # a strip that is too narrow for three
            continue
        stand_on = {_part_under(thing, parts) for thing in placed.values()}
        assert len(stand_on) == 1
        used |= stand_on
    assert len(used) > 1


def test_nothing_starts_in_a_door_that_is_open() -> None:
    layout = load_layout(10)  # whose microwave stands on the counter
    microwave = candidates(layout, "microwave")[0]
    region = SampleRegion("microwave", "nn")
    start = Placement("counter", region=region, size=(1.0, 0.5), pos=("ref", -1.0))
    fixtures = (FixtureSpec("microwave", "microwave"), FixtureSpec("counter", "counter", near="microwave"))
    task = replace(get_task("OpenMicrowave"), fixtures=fixtures, objects=(ObjectSpec("plate", ("plate",), start),))
    (door,) = open_doors_of([(microwave, 1.0)])
    footprints = {}
    for named, doors in (("without", []), ("with", [door]), ("above", [replace(door, low=3.0, high=4.0)])):
        met = []
        for seed in range(40):
            rng = np.random.default_rng(seed)
            roles = cast_roles(rng, task.fixtures, layout)
            try:
                plate = place_objects(rng, task, "target", layout, roles, {}, doors=doors)["plate"]
            except PlacementError:
                continue
            mark = Footprint(*plate.pos[:2], plate.yaw, (plate.item.size[0] / 2, plate.item.size[1] / 2))
            met.append(mark.overlaps(door.footprint))
        footprints[named] = met
    assert any(footprints["without"])
    assert footprints["without"] == footprints["above"]
    assert len(footprints["with"]) > 20
    assert not any(footprints["with"])


@pytest.mark.parametrize("style_id", [29, 11])  # slots from front to back, and along the front
def test_a_slot_may_be_narrow(style_id: int) -> None:
    layout = load_layout(12, style_id)
    toaster = candidates(layout, "toaster")[0]
    name, region = next(iter(toaster.regions.items()))
    placement = Placement("toaster", region=SampleRegion(name=name), slot=True)
    assert min(region.half[:2]) * 2 < 0.06
    assert [part.name for part in choose_parts(layout, placement, toaster, None, {})] == [name]


def test_several_footprints_answer_as_each_of_them_does() -> None:
    rng = np.random.default_rng(0)

    def draw() -> Footprint:
        x, y = rng.uniform(-1, 1, 2)
        half_x, half_y = rng.uniform(0.02, 0.4, 2)
        return Footprint(float(x), float(y), float(rng.uniform(-np.pi, np.pi)), (float(half_x), float(half_y)))

    answers = []
    for _ in range(400):
        marks, other = [draw() for _ in range(int(rng.integers(4)))], draw()
        margin = float(rng.choice([0.0, 0.1]))
        place = np.array([[other.x, other.y, other.yaw]])
        answers.append(bool(Footprints(marks).overlapping(place, other.half, margin)[0]))
        assert answers[-1] == any(mark.overlaps(other, margin) for mark in marks)
    assert 50 < sum(answers) < 350


UNIT = Footprint(0.0, 0.0, 0.0, (0.5, 0.25))


@pytest.mark.parametrize(
    ("other", "gap"),
    [
        (Footprint(1.3, 0.1, 0.0, (0.5, 0.25)), 0.3),  # side by side
        (Footprint(1.3, 0.9, 0.0, (0.5, 0.25)), 0.5),  # from corner to corner: 0.3 and 0.4
        (Footprint(1.2, 0.0, np.pi / 4, (0.3, 0.3)), 0.7 - 0.3 * np.sqrt(2)),  # a corner before a side
        (Footprint(0.0, 1.0, np.pi / 2, (0.5, 0.1)), 0.25),
        (Footprint(0.7, 0.0, 0.0, (0.5, 0.25)), 0.0),
        (Footprint(0.0, 0.0, np.pi / 2, (0.6, 0.1)), 0.0),  # crossed: no corner of one is in the other
    ],
)
def test_the_gap_of_two_rectangles(other: Footprint, gap: float) -> None:
    assert UNIT.gap(other) == pytest.approx(gap)
    assert other.gap(UNIT) == pytest.approx(gap)


def test_fixtures_that_are_to_be_apart_are_so_between_their_sides() -> None:
    task = get_task("NavigateKitchen")
    gaps, middles = [], []
    for number in layout_ids():
        layout = load_layout(number)
        try:
            roles = cast_roles(np.random.default_rng(number), task.fixtures, layout)
        except PlacementError:  # nothing is so far from this one: the builder draws again
            continue
        source, target = (layout.fixtures[roles[role]] for role in ("source", "target"))
        gaps.append(footprint(source).gap(footprint(target)))
        middles.append(float(footprint(source).distances(np.array([target.pos[:2]]))[0]))
    assert len(gaps) > 30
    assert min(gaps) >= 1.0
    # Middles are farther off than sides, or it would say the same of both.
    assert min(np.array(middles) - gaps) > 0.05


def test_what_does_not_fit_is_said_with_free_area_and_three_remedies() -> None:
    start = Placement("counter", size=(0.3, 0.3), pos=(-1.0, -1.0))
    names = ("plate", "tray", "pan", "pot", "cutting_board")
    task = _task(*(ObjectSpec(f"wide_{name}", (name,), start) for name in names))
    rng = np.random.default_rng(0)
    roles = cast_roles(rng, task.fixtures, LAYOUT)
    with pytest.raises(PlacementError, match="wide_") as failure:
        place_objects(rng, task, "target", LAYOUT, roles, {})
    assert "m2 are free" in str(failure.value)
    assert str(failure.value).count(", ") >= 2
    assert COUNTER.name in str(failure.value)


@pytest.mark.parametrize("layout_id", [2, 8, 13])
def test_robots_stand_before_stools_islands_fridges_and_towers(layout_id: int) -> None:
    layout = load_layout(layout_id)
    rng = np.random.default_rng(0)
    for kind in ("stool", "dining_counter", "fridge", "microwave", "cabinet", "stove", "dishwasher"):
        found = 0
        for fixture in candidates(layout, kind):
            try:
                pose = robot_pose(rng, layout, RobotStart(kind), fixture, PANDA_OMRON.shape)
            except PlacementError:
                assert kind == "cabinet", fixture.name  # beside a corner there may be no room: the builder draws again
                continue
            found += 1
            assert is_free(layout, pose, PANDA_OMRON.shape)
            ground = ground_fixture(layout, fixture)
            facing = np.array([np.cos(pose.yaw), np.sin(pose.yaw)])
            away = np.array([pose.x, pose.y]) - ground.pos[:2]
            assert facing @ away < 0
            if kind == "stool":
                assert faces(layout, ground, fixture)[0].clearance > 0.2
        assert found, kind
