"""How goals are joined: names of terms, what is reported of what must not hold, when two goals are equal."""

from __future__ import annotations

from typing import Any, cast

import mujoco
import pytest

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsOpen,
    DrawerOpen,
    Exactly,
    Goal,
    Not,
    PartWithin,
    StateIs,
    UnderWater,
    When,
)
from robocasa_lerobot.envs.predicates.logic import Term, terms_by_name
from robocasa_lerobot.envs.predicates.memory import parts_with_memory
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.typical import goal_of
from robocasa_lerobot.errors import UserError


def test_terms_of_one_name_are_refused_where_one_would_hide_the_other() -> None:
    near, far = DrawerOpen("drawer", 0.5), DrawerOpen("drawer", 0.9)
    out, into = PartWithin("rack", "rack0", low=0.9), PartWithin("rack", "rack0", high=0.1)
    for goal in (
        AllOf(near, far),
        AllOf(Not(near), Not(far)),
        AnyOf(out, AllOf(near, into)),
        AllOf(near, DoorsOpen("drawer")),
    ):
        with pytest.raises(UserError, match="are called `"):
            terms_by_name(goal)
    with pytest.raises(UserError, match="are called `drawer_open`"):
        terms_by_name(AllOf(When("where", {"a": near, "b": far}), near))
    # One of them alone is evaluated, or both are the same.
    assert terms_by_name(When("where", {"a": near, "b": far})) == {"drawer_open": (near, far)}
    either = AnyOf(AllOf(near, out), AllOf(near, Not(out)))
    assert terms_by_name(either).keys() == {"drawer_open", "rack0_set", "not_rack0_set"}
    assert terms_by_name(either, unwanted=False).keys() == {"drawer_open", "rack0_set"}


class _Said(Term):
    """A term that holds or does not, as said."""

    def __init__(self, name: str, value: bool) -> None:
        self._name, self.value = name, value

    @property
    def name(self) -> str:
        return self._name

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        return self.value


@pytest.mark.parametrize("value", [True, False])
def test_what_is_not_to_hold_is_reported_as_the_goal_wants_it(value: bool) -> None:
    terms: dict[str, bool] = {}
    scene, data = cast(Any, None), cast(Any, None)
    assert Not(_Said("wrong_tool_on_board", value)).evaluate(scene, data, terms) is not value
    assert terms == {"not_wrong_tool_on_board": not value}
    goal = AllOf(_Said("a", True), Not(AnyOf(_Said("b", False), _Said("c", value))))
    terms = {}
    assert goal.evaluate(scene, data, terms) is not value
    assert terms == {"a": True, "not_b": True, "not_c": not value}
    # Whatever fails is among what is reported false.
    assert goal.evaluate(scene, data, terms) == all(terms.values())


def test_goals_are_equal_where_they_ask_for_the_same() -> None:
    def goal(n: int = 1, choice: str = "a") -> Goal:
        one, other = StateIs("sink", "water_on"), Not(UnderWater("obj", "sink"))
        return AllOf(one, AnyOf(other, Exactly(n, one)), When("where", {choice: one}))

    assert goal() == goal()
    assert hash(goal()) == hash(goal())
    assert len({goal(), goal(n=2), goal(choice="b")}) == 3
    assert AllOf(*goal().inner) != AnyOf(*goal().inner)


@pytest.mark.parametrize("name", task_names())
def test_no_registered_task_hides_a_term(name: str) -> None:
    task = get_task(name)
    goal = goal_of(task)
    assert terms_by_name(goal)
    assert (task.facts.kind == "atomic") <= (parts_with_memory([goal]) == ())
