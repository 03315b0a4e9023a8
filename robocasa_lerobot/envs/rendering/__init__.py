"""Pictures of MuJoCo scenes from their cameras, without a window."""

from robocasa_lerobot.envs.rendering.canvas import ForkedContextError
from robocasa_lerobot.envs.rendering.frustum import clipping_planes, view_frustum
from robocasa_lerobot.envs.rendering.renderer import SceneRenderer

__all__ = ["ForkedContextError", "SceneRenderer", "clipping_planes", "view_frustum"]
