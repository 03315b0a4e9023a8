"""The verbs of picking and placing: pick an object and keep it; place the held one, after picking it up if need be."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from functools import partial

import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    OPEN,
    Array,
    HandTarget,
    grip_position,
    hand_rotation,
)
from robocasa_lerobot.demos.planning.base_path import base_now, wrap
from robocasa_lerobot.demos.planning.collision import Held
from robocasa_lerobot.demos.planning.errors import LostError, SlippedError
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, stage_done
from robocasa_lerobot.demos.skills.fold import fold_arm
from robocasa_lerobot.demos.skills.navigation import drive_to
from robocasa_lerobot.demos.skills.pick_place.by_handle import PAN_BY_THE_HANDLE, TOOL_BY_THE_HANDLE, has_handle
from robocasa_lerobot.demos.skills.pick_place.carrying.carry import carry_to, go_to_object, in_reach, standing_pose_for
from robocasa_lerobot.demos.skills.pick_place.carrying.loss import hangs, require_off_floor
from robocasa_lerobot.demos.skills.pick_place.carrying.torso import move_torso, torso_for
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import ANY_APPROACH, GraspStrategy
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, graspable
from robocasa_lerobot.demos.skills.pick_place.location import locate
from robocasa_lerobot.demos.skills.pick_place.pick import is_held, pick
from robocasa_lerobot.demos.skills.pick_place.place import PlaceStrategy, has_way_in, put
from robocasa_lerobot.demos.skills.pick_place.reach_in import drive_around_open_door
from robocasa_lerobot.demos.skills.pick_place.strategies import (
    grasp_strategy,
    in_the_open,
    is_on_stove,
    is_reached_up_into,
    place_strategy,
    target_object,
)
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.microwave import Microwave
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.tasks.conditions import stage_condition, without_gripper
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 4
SETTLE_STEPS = 15
BY_USE = {
    **dict.fromkeys(("stir", "press_with"), TOOL_BY_THE_HANDLE),
    **dict.fromkeys(("pour", "shake", "tilt", "turn"), PAN_BY_THE_HANDLE),
}
PLACING = ("place", "place_upside_down")
MOST_PLACES = 3  # that an object is reached for from
FAR_M = 2.0  # from where an object is to where it goes: what creeps in the fingers slips out on a longer way
OTHER_SIDE_RAD = 0.7  # between the robot's headings at two sides of a counter, at least


def pick_object(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Take hold of the stage's object where it is, after a drive if need be, and keep it.

    Raises:
        SkillError: it is not in the gripper after all attempts.
    """
    obj, following = graspable(env, stage.object), _placing(env, stage)
    far = following is None or _goes_far(env, following, obj, place_strategy(env, following, obj))
    yield from take(env, obj, free_grasp(env, stage), kept=True, far=far)


def place_object(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Put the stage's object down at its target; where it is not in the hand, it is picked up first.

    Raises:
        SkillError: it is not there after all attempts.
    """
    failed: list[Array] = []
    for attempt in range(ATTEMPTS):
        obj, there = graspable(env, stage.object), False
        strategy = place_strategy(env, stage, obj)
        fetched = not is_held(env, obj.name) and not hangs(env, obj)
        if fetched:
            if attempt == 0:
                yield from _around_door(env, _target_fixture(env, stage))
            if strategy.make_room is not None:
                yield from strategy.make_room(env, attempt > 0)
            holder = target_object(env, stage)
            towards = env.data.body(holder).xpos.copy() if holder else None
            far = _goes_far(env, stage, obj, strategy)
            there = yield from _unless_there(env, stage, take(env, obj, strategy.grasp, towards=towards, far=far))
        if not there:
            if fetched:
                obj, strategy = _as_fetched(env, stage, obj, strategy)
            try:
                yield from bring(env, stage, obj, strategy)
            except SlippedError:
                continue  # it is picked up where it lies
            yield from move_torso(env, 0.0, CLOSED, Held.now(env.data, obj.name, obj.contents))
            if strategy.anew is not None and not has_way_in(env, obj, strategy):
                yield from put(env, obj, strategy.anew, [])
                continue
            yield from put(env, obj, strategy, failed)
        for _ in range(SETTLE_STEPS):
            if stage_done(env, stage):
                return
            # What was blocked on its way is kept.
            fingers = CLOSED if is_held(env, obj.name) or hangs(env, obj) else OPEN
            yield from hold_hand(env.data, HandTarget(grip_position(env.data), hand_rotation(env.data)), fingers, 1)
    raise SkillError(f"{graspable(env, stage.object).title} is not where it belongs after {ATTEMPTS} attempts")


def _as_fetched(
    env: KitchenEnv, stage: Stage, obj: Graspable, strategy: PlaceStrategy
) -> tuple[Graspable, PlaceStrategy]:
    """An object that was picked up, and how it is put down, where either is another than before.

    What lay over it may have stayed behind, and where it goes may have been pulled out.
    """
    now = graspable(env, obj.name)
    if now.contents == obj.contents and strategy.make_room is None:
        return obj, strategy
    return now, place_strategy(env, stage, now)


def _unless_there(env: KitchenEnv, stage: Stage, taking: Iterator[Array]) -> Generator[Array, None, bool]:
    """Pick an object up, unless it comes to be where it belongs before: then the hand goes. Whether it has come there.

    What rests on others in a bowl sinks among them when it is touched.
    """
    there, steps = without_gripper(stage_condition(env.declaration, stage)), 0
    for action in taking:
        steps = steps + 1 if action[-1] == OPEN and there.evaluate(env.scene, env.data, {}) else 0
        if steps > SETTLE_STEPS:
            yield from fold_arm(env)
            return True
        yield action
    return False


def drive(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Drive to where a robot stands to use the stage's target, a fixture's role or an object's name.

    An object in the hand goes along; the stage's object, if any, is picked up where it is not in the hand.

    Raises:
        SkillError: there is no path, the base got stuck, or the object cannot be picked up.
    """
    holder = target_object(env, stage)
    obj = graspable(env, stage.object) if stage.object else None
    if obj is not None and not is_held(env, obj.name):
        yield from take(env, obj, free_grasp(env, stage), kept=True, far=True)
    if holder:
        fixture = locate(env, holder).fixture
        if fixture is None:
            raise SkillError(f"{holder} stands nowhere that a robot can drive to")
        stand = standing_pose_for(env, fixture, env.data.body(holder).xpos)
    else:
        stand = env.scene.place_before(stage.target)
    if obj is not None:
        yield from carry_to(env, obj, stand, _next_place(env, stage, obj))
    else:
        yield from fold_arm(env)  # it may still reach into what it has put something into
        yield from move_torso(env, 0.0, OPEN)
        yield from drive_to(env, stand.x, stand.y, stand.yaw)


def take(
    env: KitchenEnv,
    obj: Graspable,
    free: GraspStrategy,
    *,
    kept: bool = False,
    towards: Array | None = None,
    far: bool = False,
) -> Iterator[Array]:
    """Drive to an object where it is out of reach, and pick it in the manner of its place.

    Args:
        env: the kitchen.
        obj: to be picked up.
        free: how it is grasped where it stands in the open.
        kept: whether it stays in the hand for a later stage.
        towards: where it goes then, world, metres: the robot rather stands on that side of it.
        far: whether that is a long way off.

    Raises:
        SkillError: it is not in the gripper after all attempts.
        LostError: it fell to the floor.
    """
    been: list[RobotPose] = []
    failure: SkillError | None = None
    while True:
        require_off_floor(env, obj)
        try:
            yield from come_to(env, obj, been, towards)
        except LostError:
            raise
        except SkillError as error:
            if failure is None:
                raise
            raise failure from error  # why it was not picked up from where the robot could stand
        try:
            elsewhere = partial(_has_other_side, env, obj.name) if not been else lambda: False
            yield from pick(env, obj, grasp_strategy(env, obj, free, kept=kept), elsewhere, firm=kept, long_way=far)
            yield from move_torso(env, 0.0, CLOSED, Held.now(env.data, obj.name, graspable(env, obj.name).contents))
            return
        except LostError:
            raise
        except SkillError as error:
            if len(been) == MOST_PLACES - 1:
                raise
            failure = error
        been.append(base_now(env.data))


def come_to(
    env: KitchenEnv, obj: Graspable, other_than: Sequence[RobotPose] = (), towards: Array | None = None
) -> Iterator[Array]:
    """Drive to an object where it is out of reach, or in any case to another place, and come up to its height.

    Raises:
        SkillError: there is no room, or no path.
    """
    yield from go_to_object(env, obj.name, other_than, towards)
    fixture = locate(env, obj.name).fixture
    yield from _around_door(env, fixture)
    yield from _rise_to(env, fixture, env.data.body(obj.name).xpos.copy())


def _has_other_side(env: KitchenEnv, name: str) -> bool:
    """Whether the robot can stand at another side of what an object lies on in the open."""
    place, here = locate(env, name), base_now(env.data)
    if place.fixture is None or not in_the_open(place):
        return False
    try:
        stand = standing_pose_for(env, place.fixture, env.data.body(name).xpos.copy(), [here])
    except SkillError:
        return False
    return abs(wrap(stand.yaw - here.yaw)) > OTHER_SIDE_RAD


def bring(env: KitchenEnv, stage: Stage, obj: Graspable, strategy: PlaceStrategy) -> Iterator[Array]:
    """Carry the held object to before the stage's target, where that is out of reach.

    Raises:
        SkillError: there is no room or no path, or it slipped out of the hand.
    """
    middle, fixture = _middle(strategy), _target_fixture(env, stage)
    if fixture is None or (middle is not None and in_reach(env, middle)):
        return
    middle = np.asarray(fixture.pos) if middle is None else middle
    yield from carry_to(env, obj, standing_pose_for(env, fixture, middle), middle)


def _goes_far(env: KitchenEnv, stage: Stage, obj: Graspable, strategy: PlaceStrategy) -> bool:
    """Whether it is a long drive from where an object is to where a stage puts it down."""
    goal = _middle(strategy)
    if goal is None:
        fixture = _target_fixture(env, stage)
        if fixture is None:
            return False
        goal = np.asarray(fixture.pos)
    return float(np.linalg.norm((goal - env.data.body(obj.name).xpos)[:2])) > FAR_M


def _middle(strategy: PlaceStrategy) -> Array | None:
    """The middle of where an object may be put down, world, metres; None where that is nowhere."""
    poses = [pose.point for pose in strategy.poses()]
    return np.mean(poses, axis=0) if poses else None


def _target_fixture(env: KitchenEnv, stage: Stage) -> Fixture | None:
    holder = target_object(env, stage)
    return locate(env, holder).fixture if holder else env.scene.fixture(stage.target)


def _rise_to(env: KitchenEnv, fixture: Fixture | None, point: Array) -> Iterator[Array]:
    """Bring the torso up before a shelf of a wall cabinet, from which the empty hand is to take something; else down.

    What goes in there is in the hand, which goes level: it needs no more height than the arm has.
    """
    yield from move_torso(env, torso_for(float(point[2])) if is_reached_up_into(fixture) else 0.0, OPEN)


def _around_door(env: KitchenEnv, fixture: Fixture | None) -> Iterator[Array]:
    if isinstance(fixture, Microwave):
        yield from drive_around_open_door(env, fixture)


def free_grasp(env: KitchenEnv, stage: Stage) -> GraspStrategy:
    """How an object that stands free is grasped best for where it goes next."""
    use, obj = _next_use(env, stage), graspable(env, stage.object)
    if use in BY_USE and (use != "pour" or has_handle(obj)):
        return BY_USE[use]
    if has_handle(obj) and is_on_stove(locate(env, obj.name)):
        return PAN_BY_THE_HANDLE  # a hand at its rim has knobs and other pans beside it, and the weight turns it
    following = _placing(env, stage)
    return ANY_APPROACH if following is None else place_strategy(env, following, obj).grasp


def _next_use(env: KitchenEnv, stage: Stage) -> str:
    """The verb of the next stage that does something with a stage's object in the hand; empty where there is none."""
    stages = env.declaration.stages
    later = stages[stages.index(stage) + 1 :] if stage in stages else ()
    return next((each.verb for each in later if each.object == stage.object and each.skill == "pick_place"), "")


def _next_place(env: KitchenEnv, stage: Stage, obj: Graspable) -> Array | None:
    """The middle of where a later stage puts a stage's object down, world, metres."""
    following = _placing(env, stage)
    return None if following is None else _middle(place_strategy(env, following, obj))


def _placing(env: KitchenEnv, stage: Stage) -> Stage | None:
    """The next stage that puts a stage's object down."""
    stages = env.declaration.stages
    later = stages[stages.index(stage) + 1 :] if stage in stages else ()
    return next((e for e in later if e.skill == "pick_place" and e.verb in PLACING and e.object == stage.object), None)
