"""What stands in our declaration of a composite task for the sentences of its blueprint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    Goal,
    GripperFar,
    ObjectOn,
    ObjectTouches,
    ObjectUpright,
    OnBurner,
)
from robocasa_lerobot.envs.scene.scene_spec import InitialState
from robocasa_lerobot.envs.scene.spec import Placement

# Sentences that several blueprints have.
# Stages of which the benchmark's list has another number than its code.
MISCOUNTED = {"MakeFruitBowl": 4}
# How many of our first stages the benchmark's list leaves out, by task.
UNLISTED = {"SetupFrying": 1}
# How many of our last stages it leaves out: a door that is to be shut, a utensil that is drawn.
UNLISTED_LAST = {"PlateStoreDinner": 1, "OrganizeMetallicUtensils": 4}
ON_ITS_MIDDLE = "(contact AND xy centre distance < 0.7 x {} horizontal radius)"
NEAR_THE_MIDDLE = "(contact AND centre xy distance < 0.7 x {} radius)"
# Of saucepans with lids.
LIT_SAUCEPAN: dict[str, Goal] = {
    "saucepan on chosen burner (contact with stove; centre xy < 0.08 m of burner; its knob in [0.35, 2pi-0.35])": (
        OnBurner("saucepan", "stove", burner="{knob}", lit=True, within=0.08)
    )
}
ON_SAUCEPAN: dict[str, Goal] = {
    "saucepan_auxiliary (lid) on saucepan (contact; centre xy < 0.02 m)": ObjectOn(
        "saucepan_auxiliary", "saucepan", within=0.02
    )
}
LEVEL = frozenset({ObjectUpright("saucepan_auxiliary")})
IN_SAUCEPAN = "{} in saucepan (contact; centre xy < 0.7*saucepan radius)"


@dataclass(frozen=True)
class Ours:
    """What stands for the sentences of a blueprint.

    Attributes:
        goal: part of our goal by sentence.
        initial: initial state by sentence; None where fixtures start so anyway, or the name of an object.
        order: what stands for `order_or_memory`, if it says anything.
        besides: parts of our goal that the blueprint does not ask for.
        more_initial: further initial states that a sentence stands for.
        called: names of objects by what the blueprint's stages call them instead.
        same: roles of the blueprint that are the same fixture as another role, which ours calls by that one alone.
        turned: bounds of the turn, radians, of objects whose models lie along another axis than the blueprint's.
        drawn: roles of the blueprint that are one of several others, by which is drawn; the choice's name.
        kinds: our kinds of fixtures where the blueprint says in a sentence what is meant.
        near: what our fixtures are near where the blueprint leaves open which of a kitchen's it is, by role.
        more: roles of ours that the blueprint names in its stages alone.
        placed: ours where the blueprint's own stages would not lead from there to its goal.
        scales: ours where the blueprint's would not fit our models.
    """

    goal: dict[str, Goal]
    initial: Mapping[str, InitialState | str | None]
    order: Goal | None = None
    besides: frozenset[Goal] = frozenset()
    more_initial: frozenset[InitialState] = frozenset()
    called: dict[str, str] = field(default_factory=dict)
    same: dict[str, str] = field(default_factory=dict)
    turned: dict[str, tuple[float, float]] = field(default_factory=dict)
    drawn: dict[str, str] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    near: dict[str, str] = field(default_factory=dict)
    more: set[str] = field(default_factory=set)
    placed: dict[str, Placement] = field(default_factory=dict)
    scales: dict[str, tuple[float, float, float]] = field(default_factory=dict)


def away(*names: str, metres: float = 0.25) -> dict[str, Goal]:
    """What every blueprint says of the gripper at the end."""
    return {f"gripper > {metres} m from {name}": GripperFar(name, metres) for name in names}


def together(name: str, other: str, vessel: str) -> Goal:
    """In a vessel that is too narrow for two of our things side by side, or on the other thing in it."""
    return AnyOf(ObjectOn(name, vessel), AllOf(ObjectTouches(name, other), ObjectOn(other, vessel)))
