"""Predicates without memory: each is true in a state that was written for it, and false in near misses."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from goal_states import hold, put_object, write
from predicate_scenes import (
    PLATE,
    SINK,
    STOVE,
    TOASTER_OVEN,
    Change,
    beside,
    check_hits_and_misses,
    shift,
    state,
)

from robocasa_lerobot.envs.kitchens.appliances.kinds.racked import Racked
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import ON_FROM, Hob
from robocasa_lerobot.envs.predicates import (
    AllOf,
    Exactly,
    Goal,
    Grasped,
    GripperTouches,
    Near,
    NearerThan,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    ObjectOnRack,
    OnBurner,
    OnOneSide,
    OverBasin,
    StateIs,
    UnderWater,
)
from robocasa_lerobot.envs.predicates.contacts import touching
from robocasa_lerobot.envs.predicates.logic import every_goal_in, terms_by_name
from robocasa_lerobot.envs.predicates.objects import radius
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.tasks.registry import get_task


@pytest.fixture(scope="module")
def scenes() -> dict[str, Scene]:
    """By the role of the fixture that they are about."""
    return {
        "stove": build_scene(STOVE, "target", 4),
        "sink": build_scene(SINK, "target", 0),
        "plate": build_scene(PLATE, "target", 0),
        "basins": build_scene(get_task("PreRinseStation"), "target", 0),
        "toaster_oven": build_scene(TOASTER_OVEN, "target", 0),
    }


def away_from_stream(share: float) -> Change:
    """Put the object's middle at a share of its radius beside the stream."""

    def change(scene: Scene, data: mujoco.MjData) -> None:
        stream = data.site(f"{scene.roles['sink']}_water").xpos
        put_object(scene, data, "obj", stream + np.array([share * radius(scene, "obj"), 0.0, -0.15]))

    return change


def over_basin(basin: str, share: float, up_m: float = 0.0) -> Change:
    """Put the object over a basin, at a share of half its width beside its middle."""

    def change(scene: Scene, data: mujoco.MjData) -> None:
        region = scene.fixture("sink", Sink).regions[basin]
        data.joint("left_obj_joint0").qpos[:3] = region.world(data, (share * region.half[0], 0.0, up_m))

    return change


def water(angle: float) -> Change:
    return lambda scene, data: scene.fixture("sink", Sink).set_position(data, "handle", angle)


def knobs(angle: float) -> Change:
    def change(scene: Scene, data: mujoco.MjData) -> None:
        hob = scene.fixture("stove", Hob)
        for location in hob.burners:
            hob.set_position(data, f"knob_{location}", angle)

    return change


def finger(number: int, position_m: float) -> Change:
    def change(scene: Scene, data: mujoco.MjData) -> None:
        joint = scene.robot.names.finger_joints[number]
        data.joint(joint).qpos[0] = np.sign(sum(scene.model.joint(joint).range)) * position_m

    return change


def both_fingers(position_m: float) -> Change:
    return lambda scene, data: [finger(number, position_m)(scene, data) for number in (0, 1)]


def fist(scene: Scene, data: mujoco.MjData) -> None:
    """Push the object with closed fingers: both tips touch it, from the same side."""
    both_fingers(0.0)(scene, data)
    grip = data.site(scene.robot.names.grip_site)
    ahead = scene.robot.gripper.tips_below_grip + scene.objects["obj"].item.size[2] / 2 - 0.006
    data.joint("obj_joint0").qpos[:3] = grip.xpos + ahead * grip.xmat.reshape(3, 3)[:, 2]


def onto(burner: int, name: str = "pan") -> Change:
    """Put an object onto another burner."""

    def change(scene: Scene, data: mujoco.MjData) -> None:
        write(OnBurner(name, "stove", burner=list(scene.fixture("stove", Hob).burners)[burner]), scene, data)

    return change


def into_oven(scene: Scene, data: mujoco.MjData) -> None:
    """Below the burner, on the rack of the oven: it touches the stove too."""
    hob = scene.fixture("stove", Hob)
    oven = hob.regions["interior"]
    floor = oven.world(data, (0.0, 0.0, -oven.half[2]))
    burner = data.site(f"{hob.name}_burner_on_{hob.nearest_burner(data, floor)[0]}").xpos
    put_object(scene, data, "pan", np.array([*burner[:2], 0.0]))
    data.joint("pan_joint0").qpos[2] = floor[2] - scene.objects["pan"].item.bottom_offset - 0.0005


def onto_rack(region: str) -> Change:
    """Put the object on a rack, or on the floor below them."""

    def change(scene: Scene, data: mujoco.MjData) -> None:
        room = scene.fixture("toaster_oven", Racked).regions[region]
        floor = room.world(data, (0.0, 0.0, -room.half[2]))
        put_object(scene, data, "obj", floor)
        data.joint("obj_joint0").qpos[2] = floor[2] - scene.objects["obj"].item.bottom_offset - 0.0005

    return change


FIRST = "front_left"
# Scene, predicate, what still counts, and what does not any more, each from a state in which it holds.
CASES: dict[str, tuple[str, Goal, list[Change], list[Change]]] = {
    "under water": (
        "sink",
        UnderWater("obj", "sink"),
        [away_from_stream(0.98), water(0.41)],
        [away_from_stream(1.02), water(0.39), shift("obj", z=0.16)],
    ),
    "on any burner": (
        "stove",
        OnBurner("pan", "stove"),
        [knobs(0.0), knobs(1.0), onto(1)],
        [shift("pan", z=0.004), into_oven],
    ),
    "on one burner": (
        "stove",
        OnBurner("pan", "stove", burner=FIRST, within=0.08),
        [shift("pan", y=0.07)],
        [shift("pan", y=0.09), onto(1)],
    ),
    "on a burner that is lit": (
        "stove",
        OnBurner("pan", "stove", lit=True),
        [knobs(ON_FROM + 0.01)],
        [knobs(ON_FROM - 0.01), knobs(0.0), shift("pan", z=0.004)],
    ),
    "on a burner that is not lit": ("stove", OnBurner("pan", "stove", lit=False), [], [knobs(1.0)]),
    "on another's burner": (
        "stove",
        AllOf(OnBurner("pot", "stove", burner="rear_left"), OnBurner("pan", "stove", burner=FIRST, other_than="pot")),
        [],
        [onto(0, "pot"), onto(1)],
    ),
    "over a basin": (
        "basins",
        OverBasin("left_obj", "sink", "basin0"),
        [over_basin("basin0", 0.99), over_basin("basin0", -0.99, up_m=0.5)],
        [over_basin("basin0", 1.01), over_basin("basin0", -1.01), over_basin("basin1", 0.0)],
    ),
    "on any rack": (
        "toaster_oven",
        ObjectOnRack("obj", "toaster_oven"),
        [onto_rack("rack0"), onto_rack("rack1")],
        [shift("obj", z=0.004), onto_rack("interior")],
    ),
    "grasped": (
        "sink",
        Grasped("obj"),
        [both_fingers(0.030)],
        [finger(0, 0.04), finger(1, 0.04), fist, shift("obj", z=-0.3)],
    ),
    "gripper touches": (
        "sink",
        GripperTouches("obj"),
        [finger(0, 0.04), finger(1, 0.04), fist],
        [shift("obj", z=-0.3)],
    ),
    "near, horizontally": (
        "sink",
        Near("obj", "distr_sink", 0.15),
        [beside("obj", "distr_sink", 0.149, 2.0)],
        [beside("obj", "distr_sink", 0.151)],
    ),
    "near, in space": (
        "sink",
        Near("obj", "distr_sink", 0.15, in_space=True),
        [beside("obj", "distr_sink", 0.10, 0.10)],
        [beside("obj", "distr_sink", 0.11, 0.11)],
    ),
    "near one of several": (
        "sink",
        Near("obj", ("distr_sink", "distr_counter"), 0.15),
        [beside("obj", "distr_counter", 0.149)],
        [beside("obj", "distr_counter", 0.151)],
    ),
    "near the edge": (
        "stove",
        Near("pot", "pan", 0.25, from_edge=True),
        [lambda scene, data: beside("pot", "pan", radius(scene, "pan") + 0.249)(scene, data)],
        [lambda scene, data: beside("pot", "pan", radius(scene, "pan") + 0.251)(scene, data)],
    ),
    "nearer": (
        "sink",
        NearerThan("obj", to="distr_sink", than="distr_counter", factor=2.0),
        [],
        [beside("obj", "distr_counter", 0.0, 0.01)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_it_holds_in_its_state_and_in_no_near_miss(case: str, scenes: dict[str, Scene]) -> None:
    where, goal, hits, misses = CASES[case]
    check_hits_and_misses(scenes[where], goal, hits, misses)


@pytest.mark.parametrize(
    ("where", "goal"), [("sink", ObjectInside("{food}", "sink")), ("plate", ObjectOn("{food}", "{dish}"))]
)
def test_objects_may_be_named_by_a_choice(
    where: str, goal: Goal, scenes: dict[str, Scene], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = scenes[where]
    for name, value in (("food", "obj"), ("dish", "plate")):
        monkeypatch.setitem(scene.choices, name, value)
    data = state(scene)
    assert hold(goal, scene, data) is not None
    basin = scene.fixture("sink", Sink).regions["basin0"]
    put_object(scene, data, "obj", data.body("plate").xpos if where == "plate" else basin.world(data, (0.0, 0.0, 0.0)))
    assert hold(goal, scene, data) is None
    assert not any("{" in name for name in terms_by_name(goal))


def test_every_predicate_that_can_be_missed_by_little_is_among_the_cases() -> None:
    kinds = {type(part) for _, goal, _, _ in CASES.values() for part in every_goal_in(goal)}
    assert {UnderWater, ObjectOnRack, OnBurner, OverBasin, Grasped, GripperTouches, Near, NearerThan} <= kinds


@pytest.mark.parametrize("angle", [0.0, 30.0, 45.0])
@pytest.mark.parametrize(("share", "held"), [(0.98, True), (1.02, False)])
def test_a_round_plate_reaches_to_a_corner_of_its_box(
    share: float, held: bool, angle: float, scenes: dict[str, Scene]
) -> None:
    scene = scenes["plate"]
    data = state(scene)
    mujoco.mj_kinematics(scene.model, data)
    length, width, _ = scene.objects["plate"].item.size
    assert length == width
    away = share * 0.7 * np.hypot(length, width) / 2
    way = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle)), 0.0])
    put_object(scene, data, "obj", data.body("plate").xpos + away * way)
    assert (hold(ObjectOn("obj", "plate"), scene, data) is None) == held
    assert touching(scene.model, data, scene.subtree("obj"), scene.subtree("plate")), "of the distance alone"
    # What is longer than wide has half the diagonal of its footprint, too.
    sponge = scenes["sink"].objects["obj"].item.size
    assert sponge[0] != sponge[1]
    assert radius(scenes["sink"], "obj") == pytest.approx(np.hypot(*sponge[:2]) / 2)


@pytest.mark.parametrize(
    ("place", "inside"),
    [
        (over_basin("basin0", 0.9), True),
        (over_basin("basin1", 0.9), True),
        (over_basin("basin0", -1.5), False),
        (over_basin("basin1", 0.0, up_m=0.5), False),
    ],
)
def test_a_sink_with_two_basins_is_both_of_them(place: Change, inside: bool, scenes: dict[str, Scene]) -> None:
    scene = scenes["basins"]
    data = state(scene)
    place(scene, data)
    assert (hold(ObjectInBasin("left_obj", "sink"), scene, data) is None) == inside


def test_groups_are_compared_by_their_farthest(scenes: dict[str, Scene]) -> None:
    """Three mugs at one end, the bowl at the other: the farthest two mugs against the farthest mug and bowl."""
    scene = scenes["sink"]
    data = state(scene)
    for name, x in (("obj", 0.0), ("distr_sink", 0.1), ("distr_counter", 0.3)):
        data.joint(f"{name}_joint0").qpos[:3] = [x, -2.0, 1.0]
    pair = ("obj", "distr_sink")
    for factor, held in ((2.9, True), (3.1, False)):  # 0.1 m against 0.3 m
        goal = NearerThan(pair, to=pair, than="distr_counter", factor=factor)
        assert (hold(goal, scene, data) is None) == held


@pytest.mark.parametrize("n", range(4))
def test_exactly_so_many_hold(n: int, scenes: dict[str, Scene]) -> None:
    scene = scenes["stove"]
    data = state(scene)
    lit = [StateIs("stove", f"{location}_on") for location in ("front_left", "rear_left", "front_right")]
    for term in lit[:n]:
        write(term, scene, data)
    for wanted in range(4):
        terms: dict[str, bool] = {}
        assert Exactly(wanted, *lit).evaluate(scene, data, terms) == (wanted == n)
        assert list(terms.values()) == [True] * n + [False] * (3 - n)


def test_a_group_is_at_one_side_of_another_object_as_seen_from_before_the_fixture(scenes: dict[str, Scene]) -> None:
    scene = scenes["sink"]
    data = state(scene)
    yaw = scene.fixture("sink").yaw
    right = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    goal = OnOneSide(("obj", "distr_sink"), "distr_counter", "sink", apart=0.02)
    data.joint("distr_counter_joint0").qpos[:3] = [0.0, -2.0, 1.0]
    for first, second, held in ((0.03, 0.3, True), (-0.03, -0.3, True), (0.01, 0.3, False), (-0.1, 0.1, False)):
        for name, aside in (("obj", first), ("distr_sink", second)):
            data.joint(f"{name}_joint0").qpos[:3] = np.array([0.0, -2.0, 1.0]) + aside * right + [0.0, 0.0, 0.1]
        assert (hold(goal, scene, data) is None) == held
