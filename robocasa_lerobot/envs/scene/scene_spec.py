"""What a scene is made from, as a whole: the part of a task's declaration that the scene builder reads."""

from __future__ import annotations

from dataclasses import dataclass

from robocasa_lerobot.envs.scene.drawn import Drawn
from robocasa_lerobot.envs.scene.initial_states import Initial
from robocasa_lerobot.envs.scene.scene import Remembering
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, InitialOpenness, ObjectSpec, RobotStart

type InitialState = InitialOpenness | Initial


@dataclass(frozen=True, kw_only=True)
class SceneSpec:
    """Fixtures, objects, where the robot starts, the choices drawn at reset, and the instruction.

    Attributes:
        name: id, as in RoboCasa365.
        fixtures, objects, robot_start, initial: the scene.
        choices: drawn at reset.
        instruction: template; fields are "{side}" (where the robot stands), roles, choices and names of objects.
            "{a+b}" lists objects ("the apple and the pear", "both apples"); of counted ones "{a}" is such a list,
            "{a_count}" their number, and "{a_all}" "both" or "all three".
        paraphrases: other wordings, kept apart as novel language.
        needs: names of `kitchens.splits.EXCLUDED`, of what a layout must have: the others are left out, always.
        exclude_styles: ids of styles that do not suit it.
    """

    name: str
    fixtures: tuple[FixtureSpec, ...]
    robot_start: RobotStart
    instruction: str
    objects: tuple[ObjectSpec, ...] = ()
    initial: tuple[InitialState, ...] = ()
    choices: tuple[Choice, ...] = ()
    paraphrases: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    exclude_styles: tuple[int, ...] = ()

    def remembering(self, scene: Drawn) -> tuple[Remembering, ...]:
        """What has memory, and so needs hidden joints in the scene, the inner first."""
        return ()
