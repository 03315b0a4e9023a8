"""Bake, and what comes before and after."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsClosed,
    Goal,
    GripperFar,
    Near,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    PartWithin,
    StandsNear,
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
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_COOKIES = ("cookie0", "cookie1")


def _cookie(name: str) -> ObjectSpec:
    return ObjectSpec(
        name,
        ("cookie_dough_ball",),
        Placement(object="oven_tray"),
        scale=(1.75, 1.75, 0.75),
        repeats=name != "cookie0",
    )


COOL_BAKED_COOKIES = Task(
    name="CoolBakedCookies",
    summary="The tray stands on a counter with both cookies on it, the gripper away from it.",
    fixtures=(FixtureSpec("oven", "oven"), FixtureSpec("counter", "counter")),
    needs=("oven",),
    robot_start=RobotStart("oven"),
    choices=(Choice("rack", of="oven", last=True),),
    objects=(
        ObjectSpec(
            "oven_tray",
            ("oven_tray",),
            Placement("oven", region=SampleRegion(name="{rack}"), size=(1.0, 0.25), pos=(None, -1.0)),
            scale=(0.85, 1.0, 1.1),
        ),
        *(_cookie(name) for name in _COOKIES),
    ),
    initial=(PartAt("oven", "knob_temp", (0.5, 0.5)),),
    goal=AllOf(
        *(ObjectOn(name, "oven_tray") for name in _COOKIES),
        ObjectTouchesAnyCounter("oven_tray"),
        GripperFar("oven_tray"),
    ),
    stages=(
        Stage("doors", "open", "oven"),
        Stage("racks", "pull", "oven", part="{rack}"),
        *fetch("oven_tray", "oven", "counter"),
    ),
    instruction=(
        "Open the oven, pull the {rack} rack out and carry the tray with the cookies to a counter, where they cool."
    ),
    paraphrases=(
        "The cookies in the oven are done: put their tray on a counter.",
        "Take the cookie tray off the {rack} rack of the closed oven and let it cool on a counter.",
        "A counter should hold the tray of cookies, which the oven still has.",
        "Get the tray out of the oven, with both cookies on it, and put it down on the counter.",
    ),
)

CUPCAKE_CLEANUP = Task(
    name="CupcakeCleanup",
    summary="The cupcake lies on the counter, the bowl is in the sink, the gripper away from both.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink", size=(0.6, 0.4))),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec(
            "cupcake",
            ("cupcake",),
            Placement(
                "counter",
                region=SampleRegion(ref="sink", loc="left_right", top_size=(0.6, 0.4)),
                size=(0.35, 0.5),
                pos=("ref", -1.0),
                rotation=(1.48, 1.66),  # across: ours is longer than the place is wide
                try_to_place_in="tray",
            ),
            graspable=True,
        ),
        ObjectSpec("bowl", ("bowl",), on_counter("sink", (0.35, 0.4), loc="left_right"), graspable=True),
    ),
    goal=AllOf(
        GripperFar("cupcake"), GripperFar("bowl"), ObjectInside("bowl", "sink"), ObjectTouches("cupcake", "counter")
    ),
    stages=(
        Stage("pick_place", "place", "counter", object="cupcake"),
        Stage(
            "pick_place", "place", "sink", object="bowl", until=AllOf(ObjectInside("bowl", "sink"), GripperFar("bowl"))
        ),
    ),
    instruction="Put the cupcake from the tray on the counter, and the bowl into the sink.",
    paraphrases=(
        "Clean up after the baking: the cupcake comes off its tray, the bowl goes into the sink.",
        "The bowl belongs in the sink and the cupcake on the bare counter.",
        "Take the cupcake off the tray and lay it on the counter; the bowl is to be washed, so into the sink.",
        "Move the used bowl to the sink, after the cupcake was put down on the counter.",
    ),
)


def _served(first: str, second: str) -> Goal:
    return AllOf(ObjectOn("pastry1", first), ObjectOn("pastry2", second))


def _front(width: float, *, again: bool = True) -> Placement:
    """At the front of the counter; `again` on the part of it where the first plate is."""
    region = SampleRegion(top_size=(0.9, 0.4))
    reuse = "receptacle1" if again else ""
    return Placement("counter", region=region, size=(width, 0.4), pos=(None, -1.0), reuse_region_from=reuse)


PASTRY_DISPLAY = Task(
    name="PastryDisplay",
    summary="One pastry lies on each of the plates, the gripper away from both.",
    fixtures=(FixtureSpec("sink", "sink"), FixtureSpec("counter", "counter", size=(0.9, 0.4))),
    robot_start=RobotStart("counter", at_object="pastry1"),
    objects=(
        ObjectSpec("receptacle1", ("plate",), _front(0.9, again=False)),
        ObjectSpec("receptacle2", ("plate",), _front(0.9), repeats=True),
        ObjectSpec("pastry1", ("pastry",), _front(0.8), graspable=True),
        ObjectSpec("pastry2", ("pastry",), _front(0.8), graspable=True),
    ),
    goal=AllOf(
        GripperFar("pastry1"),
        GripperFar("pastry2"),
        AnyOf(_served("receptacle1", "receptacle2"), _served("receptacle2", "receptacle1")),
    ),
    stages=(
        Stage("pick_place", "place", "receptacle1", object="pastry1"),
        Stage("pick_place", "place", "receptacle2", object="pastry2"),
    ),
    instruction="Put the {pastry1} on one of the plates and the {pastry2} on the other.",
    paraphrases=(
        "Display the pastries, one on each plate.",
        "The {pastry1} and the {pastry2} should lie on a plate of their own.",
        "Share out {pastry1} and {pastry2} to the two plates.",
        "Neither plate stays empty: {pastry1} on one, {pastry2} on the other.",
    ),
)

_CLOSE, _OFF = 0.20, 0.15  # metres: to the bowl, and of the gripper
_COLLECTED = ("egg1", "egg2", "milk")


def _close_to_bowl(name: str) -> Goal:
    return Near(name, "bowl", _CLOSE, in_space=True)


def _beside_bowl(name: str) -> Stage:
    there = AllOf(ObjectTouches(name, "counter"), _close_to_bowl(name), GripperFar(name, _OFF))
    text = f"put the {{{name}}} on the counter beside the bowl"
    return Stage("pick_place", "place", "counter", object=name, until=there, text=text)


ORGANIZE_BAKING_INGREDIENTS = Task(
    name="OrganizeBakingIngredients",
    summary="Both eggs and the milk are within 20 cm of the bowl, the gripper 15 cm away from everything.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("counter", at_object="bowl"),
    objects=(
        ObjectSpec("bowl", ("bowl",), on_counter("sink", (0.6, 0.4), loc="left_right"), graspable=True),
        ObjectSpec("egg1", ("egg",), on_counter("sink", (0.6, 0.3), loc="left_right"), graspable=True),
        ObjectSpec("egg2", ("egg",), on_counter("sink", (0.6, 0.3), loc="left_right"), graspable=True, repeats=True),
        ObjectSpec("milk", ("milk",), on_counter("sink", (0.6, 0.5), loc="left_right"), graspable=True),
    ),
    goal=AllOf(
        *(_close_to_bowl(name) for name in _COLLECTED),
        *(GripperFar(name, _OFF) for name in ("bowl", *_COLLECTED)),
    ),
    stages=tuple(_beside_bowl(name) for name in _COLLECTED),
    instruction="Put both eggs and the milk on the counter close to the bowl.",
    paraphrases=(
        "Organize what you need to bake: the two eggs and the milk right beside the bowl.",
        "Gather the eggs and the milk that stand around the sink next to the bowl.",
        "Egg, egg and milk belong within a hand's breadth of the bowl.",
        "Move the milk and the two eggs over to the bowl.",
    ),
)


def _by_bowl(name: str) -> AllOf:
    return AllOf(ObjectTouchesAnyCounter(name), Near(name, "bowl", 0.25, from_edge=True), GripperFar(name, _OFF))


def _from_shelf(name: str) -> ObjectSpec:
    shelf = SampleRegion(name="fridge_shelf", height=(1.0, 1.5))
    return ObjectSpec(
        name.split("_")[0],
        (name,),
        Placement("fridge", region=shelf, size=(0.3, 0.25), pos=(0.0, -1.0)),
        graspable=True,
    )


COOKIE_DOUGH_PREP = Task(
    name="CookieDoughPrep",
    summary="Egg and butter stand on a counter, 25 cm from the bowl's edge at most, the gripper 15 cm away from both.",
    fixtures=(FixtureSpec("fridge", "fridge"), FixtureSpec("cabinet", "cabinet"), counter_near("cabinet")),
    robot_start=RobotStart("fridge"),
    objects=(
        _from_shelf("egg"),
        _from_shelf("butter_stick"),
        ObjectSpec(
            "distr1",
            ("any",),
            Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.3, 0.3), pos=(0.0, 0.0)),
            properties=("fridgable",),
            exclude=("egg", "butter_stick"),
        ),
        ObjectSpec("bowl", ("bowl",), on_counter("cabinet", (0.4, 0.4)), graspable=True),
        ObjectSpec("flour_bag", ("flour_bag",), in_cabinet("cabinet", (0.3, 0.3), pos=(0.0, 0.0))),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"), InitialOpenness("cabinet", 0.9, 1.0)),
    goal=AllOf(
        ObjectTouchesAnyCounter("egg"),
        ObjectTouchesAnyCounter("butter"),
        *(_by_bowl(name).parts[1] for name in ("egg", "butter")),
        *(_by_bowl(name).parts[2] for name in ("egg", "butter")),
    ),
    stages=(
        *fetch("egg", "fridge", "counter", until=_by_bowl("egg")),
        Stage("navigation", "drive", "fridge"),
        *fetch("butter", "fridge", "counter", until=_by_bowl("butter")),
    ),
    instruction="Carry the egg and the butter from the fridge to the counter, close to the bowl.",
    paraphrases=(
        "Get ready to make cookie dough: egg and butter out of the open fridge go beside the bowl.",
        "Near the bowl on the counter there should be the egg and the butter stick; both are in the fridge.",
        "Fetch the fridge's egg, then its butter, and put them down by the bowl.",
        "The dough needs egg and butter: bring them to where the bowl stands.",
    ),
)

COOL_BAKED_CAKE = Task(
    name="CoolBakedCake",
    summary="The cake is on the plate on the counter, the oven is shut, the gripper away from the cake.",
    fixtures=(FixtureSpec("oven", "oven"), counter_near("oven")),
    needs=("oven",),
    robot_start=RobotStart("oven"),
    objects=(
        ObjectSpec(
            "cake",
            ("cake",),
            Placement(
                "oven",
                region=SampleRegion(name="rack0"),
                size=(1.0, 0.45),
                pos=(0.0, -1.0),
                try_to_place_in="oven_tray",
            ),
            graspable=True,
        ),
        ObjectSpec("container", ("plate",), on_counter("oven", (0.3, 0.3))),
    ),
    goal=AllOf(
        DoorsClosed("oven"), ObjectOn("cake", "container"), ObjectTouches("container", "counter"), GripperFar("cake")
    ),
    stages=(
        Stage("doors", "open", "oven"),
        Stage("racks", "pull", "oven", part="rack0"),
        *fetch("cake", "oven", "container"),
        # The open door is where a robot stands before the oven.
        Stage("navigation", "drive", "oven", until=StandsNear("{oven}_rack0")),
        Stage("racks", "push", "oven", part="rack0"),
        Stage("doors", "lift_shut", "oven"),
    ),
    instruction=(
        "Open the oven, pull its rack out, put the cake on the plate on the counter, push the rack in and close the "
        "oven."
    ),
    paraphrases=(
        "Let the baked cake cool: out of the oven, onto the plate on the counter. Leave the oven shut.",
        "The cake on the oven's tray is done; serve it on the plate and close the oven again.",
        "Move the cake from the closed oven to the plate, then push rack and door back.",
        "On the plate with the cake, which is on the oven's rack, and shut that after.",
    ),
)


def _in_mixer(name: str) -> Goal:
    return ObjectInside(name, "stand_mixer", lower=0.5)


def _into_mixer(name: str) -> Stage:
    return Stage("pick_place", "place", "stand_mixer", object=name, until=AllOf(_in_mixer(name), GripperFar(name)))


_HEAD_DOWN = PartWithin("stand_mixer", "head", high=0.01, label="down")
_MIXES = PartWithin("stand_mixer", "knob_speed", low=0.3, label="up")

MIX_CAKE_FROSTING = Task(
    name="MixCakeFrosting",
    summary="Butter and sugar cubes are in the mixer's bowl, its head is down and its speed at 30 % at least.",
    fixtures=(FixtureSpec("stand_mixer", "stand_mixer"), counter_near("stand_mixer")),
    robot_start=RobotStart("stand_mixer"),
    objects=(
        ObjectSpec(
            "butter",
            ("butter_stick",),
            on_counter("stand_mixer", (0.45, 0.3), loc="left_right", try_to_place_in="plate"),
            graspable=True,
            scale=(0.7, 0.7, 1.0),
        ),
        ObjectSpec(
            "sugar",
            ("sugar_cube",),
            on_counter("stand_mixer", (0.3, 0.15), loc="left_right"),
            count=(2, 2),
            graspable=True,
            repeats=True,
        ),
    ),
    initial=(PartAt("stand_mixer", "head", (1.0, 1.0)), PartAt("stand_mixer", "knob_speed", (0.0, 0.0))),
    goal=AllOf(*(_in_mixer(name) for name in ("butter", "sugar_0", "sugar_1")), _MIXES, _HEAD_DOWN),
    stages=(
        *(_into_mixer(name) for name in ("butter", "sugar_0", "sugar_1")),
        Stage("doors", "lower_head", "stand_mixer", until=_HEAD_DOWN),
        Stage("knobs", "raise", "stand_mixer", part="knob_speed", until=_MIXES),
    ),
    instruction=(
        "Put the butter and both sugar cubes into the bowl of the stand mixer, lower its head and turn its speed up."
    ),
    paraphrases=(
        "Make frosting: butter and the two sugar cubes into the mixer's bowl, head down, mixer on.",
        "Into the stand mixer with the butter and the sugar cubes; then close it and let it run.",
        "The stand mixer should mix the butter with both cubes of sugar.",
        "Fill the mixer's bowl with butter and sugar cubes, tilt the head down and turn the speed knob.",
    ),
)

TASKS = (
    COOKIE_DOUGH_PREP,
    COOL_BAKED_CAKE,
    COOL_BAKED_COOKIES,
    CUPCAKE_CLEANUP,
    MIX_CAKE_FROSTING,
    ORGANIZE_BAKING_INGREDIENTS,
    PASTRY_DISPLAY,
)
