"""How to grasp an object where it is, and how to put it down where it goes: by the place alone, not by the task."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robocasa_lerobot.demos.motion import UP, hand_rotation
from robocasa_lerobot.demos.skills.drawers import make_room
from robocasa_lerobot.demos.skills.pick_place.by_handle import BY_ONE_END, PAN_BY_THE_HANDLE, has_handle, pan_grasp
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import (
    ANY_APPROACH,
    FOR_A_STACK,
    FOR_A_TIGHT_SHELF,
    FROM_A_SLOT,
    FROM_CRISPER,
    OUT_M,
    OUT_OF_DRAWER,
    GraspStrategy,
    in_radians,
)
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.location import Location, locate
from robocasa_lerobot.demos.skills.pick_place.mugs import FROM_THE_SIDE, UNDER_A_SPOUT
from robocasa_lerobot.demos.skills.pick_place.place import ASIDE_M, PlaceStrategy
from robocasa_lerobot.demos.skills.pick_place.poses.basin_poses import below_spout, is_large, on_floor, room_in
from robocasa_lerobot.demos.skills.pick_place.poses.counter_poses import NEAR_M, on_counter
from robocasa_lerobot.demos.skills.pick_place.poses.distance_poses import at_distances, distance_terms, near_to
from robocasa_lerobot.demos.skills.pick_place.poses.drawer_poses import fits_in_drawer, in_drawer
from robocasa_lerobot.demos.skills.pick_place.poses.end_first import into_mouth, within_mouth
from robocasa_lerobot.demos.skills.pick_place.poses.lid_poses import (
    between_walls,
    is_covered_later,
    is_lid,
    is_lid_of,
    on_rim,
    under_lid,
)
from robocasa_lerobot.demos.skills.pick_place.poses.place_poses import (
    COLUMNS,
    DROPS_M,
    MANY_COLUMNS,
    at_site,
    in_basin,
    in_regions,
    on_object,
    over_bowl,
    over_burners,
    over_jug,
    reach_on,
)
from robocasa_lerobot.demos.skills.pick_place.poses.plate_poses import is_flat, side_by_side
from robocasa_lerobot.demos.skills.pick_place.poses.shelf_rest import ShelfRest
from robocasa_lerobot.demos.skills.pick_place.poses.turned_poses import as_turned
from robocasa_lerobot.demos.skills.pick_place.reach_in import (
    OUT_OF_A_MICROWAVE,
    OUT_OF_A_TOASTER_OVEN,
    clear_of_counter,
    pull_out_first,
)
from robocasa_lerobot.demos.skills.pick_place.turn_over import END_FIRST, LEANS, TO_TURN, stands_askew, which_way_up
from robocasa_lerobot.demos.skills.pick_place.turning.across import (
    OUT_OF_CABINET,
    between_shelves,
    to_front,
    turn_first,
)
from robocasa_lerobot.demos.skills.pick_place.turning.handle_away import below_a_spout
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.blender import Blender
from robocasa_lerobot.envs.kitchens.appliances.kinds.coffee_machine import CoffeeMachine
from robocasa_lerobot.envs.kitchens.appliances.kinds.fridge import Fridge
from robocasa_lerobot.envs.kitchens.appliances.kinds.microwave import Microwave
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.appliances.kinds.stand_mixer import StandMixer
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob
from robocasa_lerobot.envs.kitchens.appliances.kinds.toaster import Toaster
from robocasa_lerobot.envs.kitchens.appliances.kinds.toaster_oven import ToasterOven
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture, Region
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Drawer, HingeCabinet
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.kitchens.fixtures.regions import regions_of
from robocasa_lerobot.envs.predicates.heat_and_water import OnBurner
from robocasa_lerobot.envs.predicates.logic import Not, every_goal_in
from robocasa_lerobot.envs.predicates.objects import ObjectAtSite, ObjectInside
from robocasa_lerobot.envs.predicates.placed_by import Behind
from robocasa_lerobot.envs.scene.roles import counter_of
from robocasa_lerobot.envs.tasks.conditions import IN_RANGE, stage_condition
from robocasa_lerobot.envs.tasks.task import Stage

BEFORE_FRONT_M, MOST_OUT_M = 0.03, 0.45
BEYOND_COST, FLAT_COST = 50.0, 8.0  # for each metre that something stands out beyond a rack, and is too high on it
FARTHER_M = 1.1  # of a free place on a counter from the base, where an open drawer keeps the robot off
LID_GAP_M = 0.005  # of a lid over the rim when the hand opens
RIM_ROOM_M = 0.015  # between what falls into a mouth and the mouth's edge
# A vessel as deep as this keeps what it holds when it is tilted by this much as it goes in, metres, radians.
DEEP_M, DEEP_LEAN = 0.035, float(np.deg2rad(30.0))
# Of a vessel at its rim, that is to go through a front: the hand is tilted so that it fits under the edge above, yet
# about as walls of bowls lean. Fingers that are askew to a wall turn the vessel: the grasp counts for more.
_RIM_TILTS = in_radians((46, 0.0), (40, 0.0), (52, 0.0), (34, 0.05), (58, 0.1), (64, 0.2), (24, 0.3), (0, 0.7))
LEANING_GRASP = replace(
    ANY_APPROACH,
    tilts=_RIM_TILTS,
    worse_grasp=1.0,
    among_tilts=True,
)
TIGHT_M = 0.06  # over what stands between shelves: less is a tight one
LEVEL_HAND = -0.85  # of the hand's approach along the vertical: above it, the hand looks ahead rather than down
_SMALL, _STEEP, _LEANT, _STEEPEST = np.deg2rad(25.0), np.deg2rad(30.0), np.deg2rad(45.0), np.deg2rad(55.0)
_OPEN_LEANS, _CLOSED_LEANS = (0.0, _SMALL), (0.0, _STEEP, _STEEPEST)
_DRAWER_LEANS, _BOWL_LEANS = (0.0, _STEEP, np.deg2rad(50.0)), (*_CLOSED_LEANS, np.deg2rad(80.0))
# A jug stands below a wall cabinet: the hand comes about level, from any side, and lets go over the rim.
_JUG_LEANS = tuple(np.deg2rad((60.0, 72.0, 85.0, 97.0)))
_JUG_TURNS = tuple(float(np.deg2rad(turn)) for turn in (0.0, 30.0, -30.0, 60.0, -60.0, 85.0, -85.0))


def grasp_strategy(env: KitchenEnv, obj: Graspable, free: GraspStrategy, *, kept: bool = False) -> GraspStrategy:
    """How an object is grasped where it is; `free` where it stands in the open.

    What comes out of a cabinet is drawn out altogether; out of a fridge, what is `kept` in the hand, rather than put
    down from there.
    """
    place = locate(env, obj.name)
    match place.fixture:
        case Microwave():
            return replace(OUT_OF_A_MICROWAVE, first=turn_first(obj, OUT_OF_A_MICROWAVE))
        case ToasterOven():
            first = turn_first(obj, OUT_OF_A_TOASTER_OVEN)
            return replace(OUT_OF_A_TOASTER_OVEN, first=first, nearer=to_front(obj, place))
        case Toaster() if obj.item is not None and obj.item.upright_axis is not None:
            return FROM_A_SLOT
        case CoffeeMachine():
            return UNDER_A_SPOUT
        case Drawer() as drawer:
            return replace(OUT_OF_DRAWER, first=clear_of_counter(obj, drawer))
        case HingeCabinet() if has_handle(obj):
            return replace(OUT_OF_CABINET, poses=PAN_BY_THE_HANDLE.poses)
        case HingeCabinet() as cabinet:  # the torso, which is up before a wall cabinet, goes down again
            inside = FOR_A_STACK if free is FOR_A_STACK else between_shelves(env, obj, place)
            return replace(inside, out_m=_way_out(env, obj, cabinet.regions[place.region]))
        case _ if "drawer" in place.region:
            return replace(FROM_CRISPER, first=pull_out_first(obj, place))
        case _ if in_the_open(place):
            return free
        case Fridge() as fridge if place.region:
            out_m = _way_out(env, obj, fridge.regions[place.region]) if kept else OUT_M
            return replace(between_shelves(env, obj, place), out_m=out_m)
        case _:
            return ANY_APPROACH


def _way_out(env: KitchenEnv, obj: Graspable, region: Region) -> float:
    """How far an object is to be drawn out until all of it is before a region's front, metres."""
    body = env.data.body(obj.name)
    depth = float(region.local(env.data, body.xpos)[1]) + region.half[1]
    reach = float(obj.half_extents(body.xmat.reshape(3, 3))[:2].max())
    return float(np.clip(depth + reach + BEFORE_FRONT_M, OUT_M, MOST_OUT_M))


def in_the_open(place: Location) -> bool:
    """Whether a hand from above meets no roof there; racks that are pulled out of an oven count as under one."""
    if isinstance(place.fixture, Hob):
        return place.region not in IN_RANGE
    return isinstance(place.fixture, Counter | Sink | StandMixer)


def is_reached_up_into(fixture: Fixture | None) -> bool:
    """Whether the torso goes up before something is taken from there: out of wall cabinets."""
    return isinstance(fixture, HingeCabinet)


def is_on_stove(place: Location) -> bool:
    """Whether something stands on burners: knobs and other pans are beside it."""
    return isinstance(place.fixture, Hob)


def place_strategy(env: KitchenEnv, stage: Stage, obj: Graspable) -> PlaceStrategy:
    """How the stage's object is put down at the stage's target: an object, or a part of the fixture of a role.

    An object that holds others is kept level, or nearly so where it is deep; a lid level; what is to stand otherwise
    than it does is turned over.
    """
    strategy = _by_target(env, stage, obj)
    fit = as_turned(env, stage, strategy.fit)
    # Held from the side, a vessel needs no tilt on its way in, in which its handle would turn with it.
    turned = fit is not strategy.fit and "out" in strategy.entries
    grasp = FROM_THE_SIDE if turned else strategy.grasp
    strategy = replace(strategy, poses=at_distances(env, stage, obj, strategy.poses), fit=fit, grasp=grasp)
    if is_lid(obj):
        return replace(strategy, upwards=UP, leans=(0.0,))
    upwards = which_way_up(env, stage, obj)
    if upwards is not None:
        return replace(strategy, upwards=upwards, leans=LEANS, entries=("up", "across", "out"), grasp=TO_TURN)
    if not obj.contents:
        return _end_first(env, stage, obj, strategy) if stands_askew(env, stage, obj) else strategy
    steepest = DEEP_LEAN if _is_deep(obj) else 0.0
    leans = tuple(lean for lean in (0.0, DEEP_LEAN / 2, DEEP_LEAN) if lean <= max(steepest, 0.0))
    grasp = LEANING_GRASP if strategy.grasp is ANY_APPROACH and "out" in strategy.entries else strategy.grasp
    return replace(strategy, leans=leans, grasp=grasp)


def _end_first(env: KitchenEnv, stage: Stage, obj: Graspable, strategy: PlaceStrategy) -> PlaceStrategy:
    holder = target_object(env, stage)
    if not holder or env.scene.objects[holder].item.interior is None:
        return strategy
    return replace(
        strategy, leans=END_FIRST, entries=("up", "across", "out"), poses=into_mouth(env, holder),
        fit=within_mouth(env, obj, holder), exact=True, upended=True, grasp=BY_ONE_END,
    )  # fmt: skip


def _is_deep(obj: Graspable) -> bool:
    return obj.item is not None and obj.item.interior is not None and 2 * obj.item.interior.half[2] > DEEP_M


def target_object(env: KitchenEnv, stage: Stage) -> str:
    """Name of the object that a stage's target is; empty where it is a fixture."""
    name = env.scene.fill(stage.target)
    return name if name in env.scene.objects else ""


def _by_target(env: KitchenEnv, stage: Stage, obj: Graspable) -> PlaceStrategy:
    holder = target_object(env, stage)
    if holder:
        if is_lid_of(env, obj, holder):
            return PlaceStrategy(
                on_rim(env, holder), entries=("up", "across"), grasp=ANY_APPROACH, gap_m=LID_GAP_M, exact=True
            )
        more = _more_comes(env, stage)
        if is_covered_later(env, stage, holder):
            return PlaceStrategy(
                between_walls(env, obj, holder), leans=_OPEN_LEANS, entries=("up", "across"), grasp=ANY_APPROACH,
                fit=under_lid(env, obj, holder, more=more),
            )  # fmt: skip
        poses = on_object(env, obj, holder, more=more)
        fit = side_by_side(env, obj, holder, reach_on(env, holder), more=more) if is_flat(env, holder) else None
        if in_the_open(locate(env, holder)) and not _looks_ahead(env) and in_the_open(locate(env, obj.name)):
            return PlaceStrategy(poses, leans=_OPEN_LEANS, fit=fit)
        # What is stacked on another thing slides off if it comes there at a lean.
        stacked = env.scene.objects[holder].item.interior is None and not is_flat(env, holder)
        leans = (0.0,) if stacked else _CLOSED_LEANS
        return PlaceStrategy(
            poses, leans=leans, entries=("up", "across", "out"), grasp=FOR_A_STACK if stacked else ANY_APPROACH,
            in_m=0.25, fit=fit,
        )  # fmt: skip
    fixture, part = env.scene.fixture(stage.target), env.scene.part(stage.target, stage.part)
    match fixture:
        case Counter():
            within = FARTHER_M if isinstance(locate(env, obj.name).fixture, Drawer) else NEAR_M
            poses = on_counter(env, obj, fixture, within, near_to(env, stage))
            return PlaceStrategy(poses, leans=(0.0, _STEEP), entries=("up", "across"), grasp=ANY_APPROACH)
        case Sink():
            return _into_sink(env, stage, obj, fixture)
        case CoffeeMachine():
            poses = at_site(env, f"{fixture.name}_{part}", next(iter(fixture.regions.values())))
            counter = counter_of(env.scene.layout, fixture)
            beside = PlaceStrategy(on_counter(env, obj, counter), leans=(0.0, _STEEP), entries=("up", "across"))
            return PlaceStrategy(
                poses, entries=("out", "level"), grasp=below_a_spout(obj), in_m=0.17, gap_m=0.003, anew=beside
            )
    if isinstance(fixture, Hob) and part not in IN_RANGE:
        left_out = _unwanted_burners(env, stage)
        burners = [burner for burner in fixture.burners if part in ("", burner) and burner not in left_out]
        return PlaceStrategy(over_burners(env, obj, fixture, burners), entries=("up", "across"))
    named = [(name, region) for name, region in regions_of(fixture) if name.startswith(part)]
    regions = [region for _, region in named if _counts(env, stage, region)]
    terms = distance_terms(env, stage)
    columns, behind = MANY_COLUMNS if terms else COLUMNS, any(isinstance(term, Behind) for term in terms)
    return _into_regions(env, obj, fixture, part, regions, columns, behind=behind)


def _unwanted_burners(env: KitchenEnv, stage: Stage) -> set[str]:
    """Burners on which the stage's object must not stand."""
    terms = every_goal_in(stage_condition(env.declaration, stage))
    unwanted = [term.part for term in terms if isinstance(term, Not) and isinstance(term.part, OnBurner)]
    return {env.scene.fill(term.burner) for term in unwanted if isinstance(term, OnBurner)}


def _more_comes(env: KitchenEnv, stage: Stage) -> bool:
    """Whether a stage that is not done yet puts another object on or in the same object."""
    return any(
        (other.skill, other.verb, other.target) == (stage.skill, stage.verb, stage.target)
        and other.object != stage.object
        and not stage_condition(env.declaration, other).evaluate(env.scene, env.data, {})
        for other in env.declaration.stages
    )


def _into_sink(env: KitchenEnv, stage: Stage, obj: Graspable, sink: Sink) -> PlaceStrategy:
    """A large vessel comes to stand on the basin's floor, below the spout where the stage asks for that."""
    basin = sink.regions.get(env.scene.part(stage.target, stage.part), sink.basin)
    if not is_large(obj):
        return PlaceStrategy(in_basin(env, basin), leans=_OPEN_LEANS, entries=("up", "across"))
    terms = every_goal_in(stage_condition(env.declaration, stage))
    spout = any(isinstance(term, ObjectAtSite) and term.site == "water" for term in terms)
    poses = below_spout(env, obj, sink) if spout else on_floor(env, basin)
    return PlaceStrategy(
        poses, leans=(0.0, _SMALL, _LEANT), entries=("up", "across"), in_m=0.2, fit=room_in(env, obj, basin),
        grasp=pan_grasp(obj),
    )  # fmt: skip


def _into_regions(
    env: KitchenEnv, obj: Graspable, fixture: Fixture, part: str, regions: list[Region], columns: int, *, behind: bool
) -> PlaceStrategy:
    match fixture:
        case Blender():
            return PlaceStrategy(
                over_jug(env, regions[0]), leans=_JUG_LEANS, entries=("out", "across"), in_m=0.2, turns=_JUG_TURNS,
                falls=True, aside_m=_room_beside(obj, regions[0]),
            )  # fmt: skip
        case StandMixer():
            return PlaceStrategy(
                over_bowl(env, regions[0]), leans=_BOWL_LEANS, entries=("up", "across", "out"), in_m=0.2, falls=True,
                aside_m=_room_beside(obj, regions[0]),
            )  # fmt: skip
        case Drawer() as drawer:
            return PlaceStrategy(
                in_drawer(env, drawer), leans=_DRAWER_LEANS, entries=("up", "across"),
                fit=fits_in_drawer(env, obj, drawer),
                make_room=lambda env, again: make_room(env, drawer, again),
            )  # fmt: skip
        case ToasterOven() if len(regions) == 1:  # what stands out over the edge of its rack meets the door
            return PlaceStrategy(
                on_floor(env, regions[0]), leans=_CLOSED_LEANS, entries=("up", "across", "out"),
                grasp=ANY_APPROACH, in_m=0.28,
                fit=room_in(env, obj, regions[0], out_cost=BEYOND_COST, flat_cost=FLAT_COST),
            )  # fmt: skip
        case _ if "drawer" in part:
            return PlaceStrategy(
                in_regions(env, obj, regions, DROPS_M), leans=_CLOSED_LEANS, entries=("up", "across", "out"),
                grasp=ANY_APPROACH, in_m=0.28,
            )  # fmt: skip
        case _:
            # Past the edge of what it came from, a shelf's or a drawer's, in a straight line.
            narrow = "drawer" in locate(env, obj.name).region
            rest = ShelfRest(env, obj, regions)
            # Far in, the hand and not only its fingers is below the shelf above.
            tight = isinstance(fixture, Fridge) and (behind or all(_is_tight(env, obj, region) for region in regions))
            return PlaceStrategy(
                in_regions(env, obj, regions, (0.0,), columns, behind=behind), leans=_CLOSED_LEANS,
                entries=("up", "across", "out"), grasp=FOR_A_TIGHT_SHELF if tight else ANY_APPROACH, in_m=0.28,
                narrow=narrow, fit=rest.cost, falls_off=rest.falls_off,
            )  # fmt: skip


def _room_beside(obj: Graspable, mouth: Region) -> float:
    """By how much an object may fall beside the middle of a mouth, metres: more where that is wide."""
    widest = float(obj.half_extents(np.eye(3)).max())
    return max(ASIDE_M, min(mouth.half[:2]) - widest - RIM_ROOM_M)


def _is_tight(env: KitchenEnv, obj: Graspable, region: Region) -> bool:
    """Whether a region is hardly higher than an object as it stands."""
    height = 2 * float(obj.half_extents(env.data.body(obj.name).xmat.reshape(3, 3))[2])
    return 2 * float(region.half[2]) - height < TIGHT_M


def _looks_ahead(env: KitchenEnv) -> bool:
    return float(hand_rotation(env.data)[:, 2] @ UP) > LEVEL_HAND


def _counts(env: KitchenEnv, stage: Stage, region: Region) -> bool:
    """Whether objects in a region count, where the stage's condition bounds its height."""
    floor = float(region.world(env.data, (0.0, 0.0, -region.half[2]))[2])
    for term in every_goal_in(stage_condition(env.declaration, stage)):
        if isinstance(term, ObjectInside):
            low, high, least = term.height
            return low <= floor <= high and 2 * region.half[2] >= least
    return True
