"""Load the dishwasher."""

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, DoorsOpen, GripperFar, ObjectTouches, PartWithin
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_RACK = "rack1"  # the upper one
_ABOVE = on_counter("dishwasher", (0.35, 0.25))
_SHUT = DoorsClosed("dishwasher", 0.05)


def _on_rack(name: str) -> ObjectTouches:
    return ObjectTouches(name, "dishwasher", part=_RACK)


def _load(name: str) -> Stage:
    until = AllOf(_on_rack(name), GripperFar(name))
    text = f"put the {{{name}}} on the top rack of the dishwasher"
    return Stage("pick_place", "place", "dishwasher", object=name, part=_RACK, until=until, text=text)


LOAD_DISHWASHER = Task(
    name="LoadDishwasher",
    summary="Cup and bowl are on the top rack of the dishwasher, which is shut.",
    fixtures=(FixtureSpec("dishwasher", "dishwasher"), counter_near("dishwasher")),
    robot_start=RobotStart("dishwasher", beside=True, clearance=0.25, setback=0.15),
    objects=(
        ObjectSpec("dish0", ("cup",), _ABOVE),
        ObjectSpec("dish1", ("bowl",), _ABOVE, scale=0.5),
    ),
    initial=(InitialOpenness("dishwasher", 0.9, 1.0), PartAt("dishwasher", _RACK, (1.0, 1.0))),
    goal=AllOf(_on_rack("dish0"), _on_rack("dish1"), _SHUT),
    stages=(_load("dish0"), _load("dish1"), Stage("doors", "lift_low", "dishwasher", until=_SHUT)),
    instruction="Put the {dish0} and the {dish1} on the top rack of the dishwasher and close it.",
    paraphrases=(
        "The {dish0} and the {dish1} on the counter need washing: load them into the dishwasher and shut its door.",
        "Fill the upper rack of the dishwasher with {dish0} and {dish1}, then close the dishwasher.",
        "Clear the {dish0} and the {dish1} into the open dishwasher, on its top rack, and fold the door up.",
        "Both dishes go on the dishwasher's upper rack. Leave the dishwasher closed.",
    ),
)

_WIDE = DoorsOpen("dishwasher", 0.7)
_HALF_OUT = PartWithin("dishwasher", _RACK, low=0.5, label="out")

PREPARE_DISHWASHER = Task(
    name="PrepareDishwasher",
    summary="The dishwasher is open and its top rack pulled out.",
    fixtures=(FixtureSpec("dishwasher", "dishwasher"),),
    robot_start=RobotStart("dishwasher", beside=True, clearance=0.275, setback=0.1),
    goal=AllOf(_WIDE, _HALF_OUT),
    stages=(
        Stage("doors", "open", "dishwasher", until=_WIDE),
        Stage(
            "racks",
            "pull",
            "dishwasher",
            part=_RACK,
            until=_HALF_OUT,
            text="pull the top rack of the dishwasher out",
        ),
    ),
    instruction="Open the dishwasher and pull out its top rack.",
    paraphrases=(
        "Prepare the dishwasher: door down, upper rack out.",
        "The dishwasher will be loaded; open it and slide the top rack towards you.",
        "Fold the dishwasher's door down, then draw out the upper of its racks.",
        "I want to fill the dishwasher's top rack, so open up and pull it out.",
    ),
)

TASKS = (LOAD_DISHWASHER, PREPARE_DISHWASHER)
