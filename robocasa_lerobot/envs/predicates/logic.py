"""Goals: named conditions on the state of a scene, joined by and, or, not."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import mujoco

from robocasa_lerobot.errors import UserError

if TYPE_CHECKING:
    from robocasa_lerobot.envs.scene.drawn import Drawn
    from robocasa_lerobot.envs.scene.scene import Scene


_NEGATED = "not_"  # before the names of what is not to hold


class Goal(ABC):
    """Something that holds or does not hold in a state."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What it is called, e.g. in the names of terms that are about it."""

    @property
    def inner(self) -> tuple[Goal, ...]:
        """The goals that it is made of."""
        return ()

    @abstractmethod
    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Whether it holds; every named term that it is made of is written to `terms`."""

    def bound(self, scene: Drawn) -> Goal:
        """The same in a scene, without what depends on what was drawn."""
        return self


class Term(Goal):
    """A single named condition; its name is its key in `info["success_terms"]`."""

    @abstractmethod
    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Whether the condition holds."""

    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Evaluate and note the result under the term's name."""
        terms[self.name] = self.holds(scene, data)
        return terms[self.name]


class Joined(Goal):
    """What joins other goals; equal to another one that joins equal goals by the same rule."""

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and vars(other) == vars(self)

    def __hash__(self) -> int:
        return hash((type(self), self.inner))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(map(repr, self.inner))})"


class Several(Joined):
    """What joins any number of goals. All parts are evaluated, so that a failure names all that is missing."""

    def __init__(self, *parts: Goal) -> None:
        self.parts = parts

    @property
    def inner(self) -> tuple[Goal, ...]:
        """The parts."""
        return self.parts

    @property
    def name(self) -> str:
        """E.g. `obj_on_plate_or_obj_on_bowl`."""
        return "_or_".join(part.name for part in self.parts)

    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Evaluate every part."""
        return self.judge([part.evaluate(scene, data, terms) for part in self.parts])

    @abstractmethod
    def judge(self, held: Sequence[bool]) -> bool:
        """Whether it holds, by which parts do."""

    def bound(self, scene: Drawn) -> Goal:
        """Bind every part."""
        return self.of(*(part.bound(scene) for part in self.parts))

    def of(self, *parts: Goal) -> Goal:
        """The same of other parts."""
        return type(self)(*parts)


class AllOf(Several):
    """Every part holds."""

    @property
    def name(self) -> str:
        """E.g. `sink_water_on_and_sink_left`."""
        return "_and_".join(part.name for part in self.parts)

    def judge(self, held: Sequence[bool]) -> bool:
        """All of them."""
        return all(held)


class AnyOf(Several):
    """At least one part holds."""

    def judge(self, held: Sequence[bool]) -> bool:
        """Any of them."""
        return any(held)


class Exactly(Several):
    """As many of several goals hold as are wanted, and no more; their terms are reported as they are."""

    def __init__(self, n: int, *parts: Goal) -> None:
        super().__init__(*parts)
        self.n = n

    @property
    def name(self) -> str:
        """E.g. `exactly_1_of_bun1_on_plate_or_bun2_on_plate`."""
        return f"exactly_{self.n}_of_{super().name}"

    def judge(self, held: Sequence[bool]) -> bool:
        """Count them."""
        return sum(held) == self.n

    def of(self, *parts: Goal) -> Goal:
        """As many of other parts."""
        return Exactly(self.n, *parts)


class Not(Joined):
    """The part does not hold; of its terms it is reported that they do not: true always is as the goal wants."""

    def __init__(self, part: Goal) -> None:
        self.part = part

    @property
    def name(self) -> str:
        """E.g. `not_obj_on_plate`."""
        return f"{_NEGATED}{self.part.name}"

    @property
    def inner(self) -> tuple[Goal, ...]:
        """The part."""
        return (self.part,)

    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Evaluate the part; `x` is reported as `not_x`."""
        own: dict[str, bool] = {}
        held = self.part.evaluate(scene, data, own)
        terms.update({f"{_NEGATED}{name}": not value for name, value in own.items()})
        return not held

    def bound(self, scene: Drawn) -> Goal:
        """Bind the part."""
        return Not(self.part.bound(scene))


class When(Joined):
    """One of several goals, by a value that was drawn at reset (`scene.spec.Choice`)."""

    def __init__(self, choice: str, goals: Mapping[str, Goal]) -> None:
        self.choice, self.goals = choice, dict(goals)

    @property
    def name(self) -> str:
        """E.g. `obj_on_plate_or_obj_on_bowl`."""
        return "_or_".join(dict.fromkeys(part.name for part in self.inner))

    @property
    def inner(self) -> tuple[Goal, ...]:
        """The goals of all values."""
        return tuple(self.goals.values())

    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Evaluate the goal of the value that was drawn."""
        return self.bound(scene).evaluate(scene, data, terms)

    def bound(self, scene: Drawn) -> Goal:
        """The goal of the value that was drawn."""
        return self.goals[scene.choices[self.choice]].bound(scene)


class ForEach(Goal):
    """A goal for every one of the objects of a name, as many as were drawn; each has terms of its own.

    Args:
        object: name in the declaration; where several were drawn, their names are `<object>_0`, `<object>_1`, ...
        make: the goal of the object of a name, which it should use in the names of its terms.
    """

    def __init__(self, object: str, make: Callable[[str], Goal]) -> None:
        self.object, self.make = object, make

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ForEach) and (other.object, other.pattern) == (self.object, self.pattern)

    def __hash__(self) -> int:
        return hash((ForEach, self.object, self.pattern))

    @property
    def name(self) -> str:
        """E.g. `each_ice_i_on_cup`."""
        return f"each_{self.pattern.name}"

    @property
    def pattern(self) -> Goal:
        """The goal of any of them, `<object>_i`; for readers without a scene."""
        return self.make(f"{self.object}_i")

    @property
    def inner(self) -> tuple[Goal, ...]:
        """The goal of any of them."""
        return (self.pattern,)

    def evaluate(self, scene: Scene, data: mujoco.MjData, terms: dict[str, bool]) -> bool:
        """Evaluate the goal of every one."""
        return self.bound(scene).evaluate(scene, data, terms)

    def bound(self, scene: Drawn) -> Goal:
        """All of the goals of those that the scene has."""
        goals = [self.make(name).bound(scene) for name in scene.named(self.object)]
        return goals[0] if len(goals) == 1 else AllOf(*goals)


def every_goal_in(goal: Goal) -> Iterator[Goal]:
    """Everything that a goal is made of, the inner before the outer; itself last."""
    for part in goal.inner:
        yield from every_goal_in(part)
    yield goal


def terms_by_name(goal: Goal, *, unwanted: bool = True) -> dict[str, tuple[Term, ...]]:
    """The terms that `evaluate` reports; several of one name only where `When` takes one of them.

    A term under `Not` has the name under which it is reported, `not_x`; it is left out where none that are `unwanted`
    are asked for.

    Raises:
        UserError: two different terms of one name: one of them would be lost.
    """
    if isinstance(goal, Term):
        return {goal.name: (goal,)}
    if isinstance(goal, Not):
        own = terms_by_name(goal.part) if unwanted else {}
        return {f"{_NEGATED}{name}": terms for name, terms in own.items()}
    found: dict[str, tuple[Term, ...]] = {}
    for part in goal.inner:
        for name, terms in terms_by_name(part, unwanted=unwanted).items():
            before = found.get(name, ())
            clash = next(((a, b) for a in before for b in terms if a != b), None)
            if clash is not None and not isinstance(goal, When):
                raise UserError(
                    f"two terms of a goal are called `{name}`: {clash[0]} and {clash[1]}. The value of one would hide "
                    "the other's: expected a name of its own for each (some terms take a `label`), or equal terms."
                )
            found[name] = before + tuple(term for term in terms if term not in before)
    return found


def plain(name: str) -> str:
    """A name without the braces of choices, for the names of terms."""
    return name.replace("{", "").replace("}", "")
