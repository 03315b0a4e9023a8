"""A fixture declares what it can do; nobody asks it which class it is, but for the few that are listed here."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator

from source_tree import PACKAGE

from robocasa_lerobot.envs.kitchens.appliances.catalogue import kinds
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.layout import load_layout

# Where a class may still be asked for, how often, and why. Do not add to it: declare a capability on `Fixture`.
ALLOWED: dict[tuple[str, str], int] = {
    # A counter is no equal of other fixtures: it is what they stand on or are cut into, and roles are cast by it.
    ("envs/kitchens/fixture_types.py", "Counter"): 4,
    ("envs/kitchens/plan/islands.py", "Counter"): 1,
    ("envs/predicates/objects.py", "Counter"): 1,
    ("envs/scene/placement/regions.py", "Counter"): 1,
    ("envs/scene/robot_poses.py", "Counter"): 1,
    ("envs/scene/roles.py", "Counter"): 3,
    ("demos/skills/pick_place/location.py", "Counter"): 1,
    ("envs/tasks/stage_text.py", "Counter"): 1,
    # What a tool is used on: the whole top of the one, the basin of the other.
    ("demos/skills/pick_place/tools/surfaces.py", "Counter"): 1,
    ("demos/skills/pick_place/tools/surfaces.py", "Sink"): 1,
    # What a drawer is built in under, and comes out from.
    ("demos/skills/pick_place/poses/drawer_poses.py", "Counter"): 1,
    # What a place at a fixture is called: under a spout, on a burner.
    ("envs/tasks/stage_text.py", "CoffeeMachine"): 1,
    ("envs/tasks/stage_text.py", "Hob"): 1,
    # Its door opens between the robot and the cavity, and is driven around.
    ("demos/skills/pick_place/verbs.py", "Microwave"): 1,
}
# Tables by class: how an object is grasped and put down is a choice of the skill for each kind of place, tuned for it.
TABLES = {"demos/skills/pick_place/strategies.py"}


def fixture_classes() -> set[str]:
    """Names of all classes of fixtures, once every module that has one is loaded."""
    assert kinds()
    assert load_layout(1)

    def below(kind: type) -> Iterator[type]:
        for sub in kind.__subclasses__():
            yield sub
            yield from below(sub)

    return {kind.__name__ for kind in (Fixture, *below(Fixture))}


def asked_for(tree: ast.AST) -> Iterator[str]:
    """Names that `isinstance`, `issubclass`, `type(x) is` and `match` patterns ask for."""
    for node in ast.walk(tree):
        kinds: list[ast.AST] = []
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            if node.func.id in ("isinstance", "issubclass") and len(node.args) == 2:
                kinds = [node.args[1]]
        elif isinstance(node, ast.Compare) and isinstance(node.left, ast.Call):
            if isinstance(node.left.func, ast.Name) and node.left.func.id == "type":
                kinds = list(node.comparators)
        elif isinstance(node, ast.MatchClass):
            kinds = [node.cls]
        for kind in kinds:
            for part in ast.walk(kind):
                if isinstance(part, ast.Name):
                    yield part.id
                elif isinstance(part, ast.Attribute):
                    yield part.attr


def test_the_search_sees_every_form() -> None:
    code = """
isinstance(f, Sink)
isinstance(f, kinds.Oven | Drawer)
issubclass(f, (Hob, Fridge))
type(f) is Blender
match f:
    case Toaster():
        pass
"""
    wanted = {"Sink", "Oven", "Drawer", "Hob", "Fridge", "Blender", "Toaster"}
    assert wanted <= set(asked_for(ast.parse(code)))


def test_nobody_asks_a_fixture_for_its_class() -> None:
    classes = fixture_classes()
    assert {"Sink", "Drawer", "HingeCabinet", "Counter", "Fridge", "Appliance"} <= classes
    found: Counter[tuple[str, str]] = Counter()
    for path in sorted(PACKAGE.rglob("*.py")):
        source = path.relative_to(PACKAGE).as_posix()
        if not source.startswith("envs/kitchens/appliances/") and source not in TABLES:
            names = asked_for(ast.parse(path.read_text()))
            found.update((source, name) for name in names if name in classes)
    assert dict(found) == ALLOWED
    assert all((PACKAGE / table).is_file() for table in TABLES)
