"""Toast bread."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsClosed,
    Goal,
    GripperFar,
    Near,
    ObjectOn,
    ObjectOnRack,
    ObjectTouches,
    Once,
    PartWithin,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool
from robocasa_lerobot.envs.tasks.task import Stage, Task

_IN_SLOT = ObjectTouches("obj", "toaster", part="lever{_side}")  # the lift below the slot is of the lever
_TOASTING = Once(AllOf(_IN_SLOT, StateIs("toaster", "on{_side}")), label="bread_toasted")
# After the toasting, still in the slot: it has popped up there.
_POPPED = Once(
    AllOf(
        _TOASTING,
        _IN_SLOT,
        StateIs("toaster", "on{_side}", value=False),
        PartWithin("toaster", "lever{_side}", high=0.30, label="up"),
    ),
    label="bread_popped_up",
)

GET_TOASTED_BREAD = Task(
    name="GetToastedBread",
    summary="The bread was toasted, has popped up in its slot and lies on the plate, the gripper away.",
    fixtures=(
        FixtureSpec("toaster", "toaster"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("toaster"),
    choices=(Choice("slot", of="toaster"),),
    objects=(
        ObjectSpec(
            "obj",
            ("sandwich_bread",),
            Placement("toaster", region=SampleRegion(name="slot{slot}"), rotation=(0.0, 0.0), margin=0.0, slot=True),
            scale=(1.0, 1.0, 1.15),
            upright=True,
        ),
        ObjectSpec(
            "plate",
            ("plate",),
            Placement("dining_counter", region=SampleRegion(ref="stool"), size=(0.5, 0.3), pos=(0.0, "ref")),
        ),
    ),
    goal=AllOf(_TOASTING, _POPPED, ObjectOn("obj", "plate"), GripperFar("obj")),
    stages=(
        Stage(
            "levers",
            "press",
            "toaster",
            part="lever{_side}",
            until=_POPPED,
            text="press the lever of the toaster and wait until the bread pops up",
        ),
        Stage("pick_place", "pick", "toaster", object="obj"),
        Stage("navigation", "drive", "plate", object="obj"),
        Stage("pick_place", "place", "plate", object="obj"),
    ),
    instruction=(
        "Push the toaster's lever down, wait for the bread to pop up, and take it to the plate on the dining counter."
    ),
    paraphrases=(
        "Toast the bread, and when it is done serve it on the plate at the dining counter.",
        "Start the toaster; as soon as the slice is up again, carry it over to the dining counter's plate.",
        "The slice in the toaster should be toasted and end on the plate on the dining counter.",
        "Press the toaster down, let it finish, then lay the toast on the plate in front of the stool.",
    ),
)

_OVEN = (FixtureSpec("toaster_oven", "toaster_oven"), counter_near("toaster_oven"))
_RACK = Choice("rack", of="toaster_oven")
_PULL, _PUSH = (Stage("racks", verb, "toaster_oven", part="{rack}") for verb in ("pull", "push"))
_SHUT = Stage("doors", "lift_shut", "toaster_oven")


def _onto_rack(name: str, rack: str = "{rack}", text: str = "") -> Stage:
    there = AllOf(ObjectTouches(name, "toaster_oven", part=rack), GripperFar(name))
    return Stage("pick_place", "place", "toaster_oven", object=name, part=rack, until=there, text=text)


_TIMER = PartWithin("toaster_oven", "knob_time", low=0.10, label="set")

TOAST_BAGEL = Task(
    name="ToastBagel",
    summary="The bagel lies on a rack of the toaster oven, which is shut, its timer at 10 % at least; gripper away.",
    fixtures=_OVEN,
    robot_start=RobotStart("toaster_oven"),
    choices=(_RACK,),
    objects=(
        ObjectSpec(
            "bagel",
            ("bagel",),
            on_counter("toaster_oven", (0.7, 0.3), loc="left_right", try_to_place_in="plate"),
        ),
    ),
    initial=(InitialOpenness("toaster_oven", 1.0, 1.0), PartAt("toaster_oven", "knob_time", (0.0, 0.0))),
    goal=AllOf(ObjectOnRack("bagel", "toaster_oven"), DoorsClosed("toaster_oven"), _TIMER, GripperFar("bagel")),
    stages=(
        _PULL,
        _onto_rack("bagel"),
        _PUSH,
        _SHUT,
        Stage("knobs", "raise", "toaster_oven", part="knob_time", until=_TIMER),
    ),
    instruction="Put the bagel from its plate on a rack of the toaster oven, close the door and turn the timer up.",
    paraphrases=(
        "Toast the bagel in the toaster oven.",
        "The bagel goes off the plate and into the toaster oven; shut that and set some time.",
        "Lay the bagel on the toaster oven's rack, close it up and start the timer.",
        "With the bagel inside and the door closed, the toaster oven should run.",
    ),
)

_COOLEST = PartWithin("toaster_oven", "knob_temp", high=0.05, label="lowest")

TOAST_BAGUETTE = Task(
    name="ToastBaguette",
    summary="The baguette lies on a rack of the toaster oven, which is shut, its temperature at 5 % at most.",
    fixtures=_OVEN,
    robot_start=RobotStart("toaster_oven"),
    choices=(_RACK,),
    objects=(
        ObjectSpec("baguette_container", ("plate",), on_counter("toaster_oven", (0.5, 0.3), loc="left_right")),
        ObjectSpec(
            "baguette", ("baguette",), Placement(object="baguette_container", ensure_inside=False), graspable=True
        ),
    ),
    initial=(InitialOpenness("toaster_oven", 1.0, 1.0), PartAt("toaster_oven", "knob_temp", (0.2, 1.0))),
    goal=AllOf(ObjectOnRack("baguette", "toaster_oven"), DoorsClosed("toaster_oven"), _COOLEST),
    stages=(
        _PULL,
        _onto_rack("baguette"),
        _PUSH,
        _SHUT,
        Stage("knobs", "lowest", "toaster_oven", part="knob_temp", until=_COOLEST),
    ),
    instruction=(
        "Put the baguette from the plate on a rack of the toaster oven, close the door and turn the temperature all "
        "the way down."
    ),
    paraphrases=(
        "Warm the baguette gently: into the toaster oven with it, door shut, least heat.",
        "Lay the baguette on the toaster oven's rack, shut that and set its temperature to the minimum.",
        "The baguette should lie in the closed toaster oven, at the lowest temperature.",
        "Off the plate and onto the rack with the baguette; close the toaster oven, take its heat back to the stop.",
    ),
)

_LEVELS = {
    "rack0": {"bread_position": "bottom", "meat_position": "top", "_meat_level": "rack1"},
    "rack1": {"bread_position": "top", "meat_position": "bottom", "_meat_level": "rack0"},
}


def _load(name: str, level: str) -> tuple[Stage, ...]:
    rack = f"the {{{name}_position}} rack of the toaster oven"
    return (
        Stage("racks", "pull", "toaster_oven", part=level, text=f"pull {rack} out"),
        _onto_rack(name, level, f"put the {{{name}}} on {rack}"),
        Stage("racks", "push", "toaster_oven", part=level, text=f"push {rack} in"),
    )


TOAST_ON_CORRECT_RACK = Task(
    name="ToastOnCorrectRack",
    summary="Bread and meat lie on the racks that are named for them, the gripper away from both.",
    fixtures=(FixtureSpec("toaster_oven", "toaster_oven_with_two_racks"), counter_near("toaster_oven")),
    robot_start=RobotStart("toaster_oven"),
    choices=(Choice("bread_level", _LEVELS),),
    objects=(
        ObjectSpec(
            "bread",
            ("bread_food",),
            on_counter("toaster_oven", (0.75, 0.5), loc="left_right", try_to_place_in="plate"),
            graspable=True,
        ),
        ObjectSpec(
            "meat",
            ("meat",),
            on_counter("toaster_oven", (0.75, 0.5), loc="left_right", try_to_place_in="plate"),
            graspable=True,
            exclude=("fish", "shrimp"),
        ),
    ),
    goal=AllOf(
        ObjectTouches("bread", "toaster_oven", part="{bread_level}"),
        ObjectTouches("meat", "toaster_oven", part="{_meat_level}"),
        GripperFar("bread"),
        GripperFar("meat"),
    ),
    stages=(
        Stage("doors", "open", "toaster_oven"),
        *_load("bread", "{bread_level}"),
        *_load("meat", "{_meat_level}"),
    ),
    instruction=(
        "Open the toaster oven and put the {bread} on its {bread_position} rack and the {meat} on its {meat_position} "
        "rack."
    ),
    paraphrases=(
        "Both racks of the toaster oven are needed: {bread} on the {bread_position} one, {meat} on the other.",
        "Load the closed toaster oven: its {meat_position} rack with the {meat}, its {bread_position} rack with the "
        "{bread}.",
        "In the toaster oven, the {bread_position} rack is for the {bread}, the {meat_position} rack for the {meat}.",
        "Open the toaster oven, then the {bread} goes on the {bread_position} rack, the {meat} on the {meat_position}.",
    ),
)

_SLICES = ("bread_slice_1", "bread_slice_2")


def _in_toaster(slot: str, across: float) -> Placement:
    region = SampleRegion(name=slot)
    return Placement("toaster", region=region, pos=(across, None), rotation=(0.0, 0.0), margin=0.0, slot=True)


def _slice(name: str, slot: str, across: float = 0.0, *, repeats: bool = False) -> ObjectSpec:
    return ObjectSpec(name, ("sandwich_bread",), _in_toaster(slot, across), upright=True, repeats=repeats)


def _in_bowl(name: str, other: str) -> Goal:
    """In the bowl, or on the slice that is."""
    return AnyOf(ObjectOn(name, "bowl"), AllOf(ObjectTouches(name, other), ObjectOn(other, "bowl")))


_BOTH_IN_BOWL = AllOf(_in_bowl(*_SLICES), _in_bowl(*reversed(_SLICES)))
_BY_SPREADS = AllOf(
    ObjectTouches("bowl", "dining_counter"),
    *(Near("bowl", name, 0.4) for name in ("peanut_butter", "jelly")),
    GripperFar("bowl"),
)

PJ_SANDWICH_PREP = Task(
    name="PJSandwichPrep",
    summary=(
        "Both slices are in the bowl, the bowl on the dining counter, within 40 cm of peanut butter and jam, the "
        "gripper away from it."
    ),
    fixtures=(
        FixtureSpec("toaster", "toaster"),
        counter_near("toaster"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("toaster"),
    objects=(
        _slice("bread_slice_1", "slot0", -1.0),
        _slice("bread_slice_2", "slot1", 1.0, repeats=True),
        ObjectSpec("bowl", ("bowl",), on_counter("toaster", (0.8, 0.35))),
        ObjectSpec("peanut_butter", ("peanut_butter",), before_stool((0.35, 0.3), pos=(0.0, "ref"))),
        ObjectSpec("jelly", ("jam",), before_stool((0.7, 0.3), pos=(0.0, "ref"))),
    ),
    goal=AllOf(AnyOf(*(ObjectOn(name, "bowl") for name in _SLICES)), _BOTH_IN_BOWL, *_BY_SPREADS.parts),
    stages=(
        Stage("pick_place", "place", "bowl", object="bread_slice_1"),
        Stage(
            "pick_place",
            "place",
            "bowl",
            object="bread_slice_2",
            until=AllOf(_in_bowl("bread_slice_2", "bread_slice_1"), GripperFar("bread_slice_2")),
        ),
        Stage("pick_place", "pick", "counter", object="bowl"),
        Stage("navigation", "drive", "peanut_butter", object="bowl"),
        Stage(
            "pick_place",
            "place",
            "dining_counter",
            object="bowl",
            until=_BY_SPREADS,
            text="put the bowl on the dining counter beside the peanut butter and the jam",
        ),
    ),
    instruction=(
        "Put both slices of bread from the toaster into the bowl and carry the bowl to the peanut butter and the jam "
        "on the dining counter."
    ),
    paraphrases=(
        "Get ready for sandwiches with peanut butter and jam: bring the toaster's bread to them, in the bowl.",
        "The two slices in the toaster go into the bowl, the bowl close to the jam and the peanut butter.",
        "Take the toast out, both slices into the bowl, and serve it by the spreads on the dining counter.",
        "Peanut butter and jam wait on the dining counter for the bowl with both slices of bread.",
    ),
)

_SIDES = {
    "0": {"_slot": "slot0", "_free": "slot1", "_other": "slot2", "working_side": "left", "broken_side": "right"},
    "1": {"_slot": "slot2", "_free": "slot3", "_other": "slot0", "working_side": "right", "broken_side": "left"},
}


def _in_working(name: str) -> Goal:
    return ObjectTouches(name, "toaster", part="lever{working}")  # the lift below the slot is of the lever


_STARTED = StateIs("toaster", "on{working}")

TOAST_ONE_SLOT_PAIR = Task(
    name="ToastOneSlotPair",
    summary="Both slices stand in the slots of the side that works, which is on.",
    fixtures=(FixtureSpec("toaster", "toaster_with_four_slots"),),
    robot_start=RobotStart("toaster"),
    choices=(Choice("working", _SIDES),),
    objects=(_slice("bread_broken", "{_other}"), _slice("bread_working", "{_slot}", repeats=True)),
    goal=AllOf(_in_working("bread_broken"), _in_working("bread_working"), _STARTED),
    stages=(
        Stage(
            "pick_place",
            "place",
            "toaster",
            object="bread_broken",
            part="{_free}",
            until=AllOf(_in_working("bread_broken"), GripperFar("bread_broken")),
            text="put the {bread_broken} from the {broken_side} side into the free slot on the {working_side} side",
        ),
        Stage(
            "levers",
            "press",
            "toaster",
            part="lever{working}",
            until=_STARTED,
            text="press the lever of the {working_side} side of the toaster",
        ),
    ),
    instruction=(
        "The {broken_side} side of the toaster is broken: put its slice into the free slot on the {working_side} side "
        "and press that side's lever down."
    ),
    paraphrases=(
        "Toast both slices on the {working_side} side, since the other one does not heat.",
        "Only the {working_side} side of the toaster works; both slices belong there, and its lever down.",
        "Move the bread from the {broken_side} side to the empty slot on the {working_side}, then start that side.",
        "Do not use the {broken_side} side: its slice goes over to the {working_side} side, which is to be started.",
    ),
)

SERVE_WARM_CROISSANT = Task(
    name="ServeWarmCroissant",
    summary="The croissant is on the plate, the gripper away from it.",
    fixtures=_OVEN,
    robot_start=RobotStart("toaster_oven"),
    choices=(_RACK,),
    objects=(
        ObjectSpec(
            "croissant",
            ("croissant",),
            Placement("toaster_oven", region=SampleRegion(name="{rack}"), size=(0.7, 0.25), pos=(0.0, -1.0)),
            graspable=True,
        ),
        ObjectSpec("plate", ("plate",), on_counter("toaster_oven", (0.7, 0.3), loc="left_right")),
    ),
    goal=AllOf(ObjectOn("croissant", "plate"), GripperFar("croissant")),
    stages=(
        Stage("doors", "open", "toaster_oven"),
        _PULL,
        Stage("pick_place", "place", "plate", object="croissant"),
    ),
    instruction="Open the toaster oven, take the croissant off its {rack} and put it on the plate.",
    paraphrases=(
        "Serve the warm croissant, which is in the closed toaster oven on the {rack}, on the plate.",
        "The croissant in the toaster oven belongs on the plate beside it.",
        "Get the croissant out of the toaster oven, from the {rack}, and onto the plate.",
        "On the plate with the croissant that the toaster oven keeps warm.",
    ),
)

TASKS = (
    GET_TOASTED_BREAD,
    PJ_SANDWICH_PREP,
    SERVE_WARM_CROISSANT,
    TOAST_BAGEL,
    TOAST_BAGUETTE,
    TOAST_ON_CORRECT_RACK,
    TOAST_ONE_SLOT_PAIR,
)
