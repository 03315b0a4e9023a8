"""One episode ready to be written: validated columns, its instruction, and its pictures step by step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.convert.mapping.instruction import instruction_of
from robocasa_lerobot.convert.reading.demo import RejectedEpisodeError
from robocasa_lerobot.convert.reading.demo_file import DemoFile
from robocasa_lerobot.convert.reading.stages import stages_of
from robocasa_lerobot.convert.scenes.demo_scene import DemoScene
from robocasa_lerobot.convert.scenes.prefetch import ScenesAhead
from robocasa_lerobot.convert.settings import Camera, Plan, needs_scene
from robocasa_lerobot.errors import UserError

if TYPE_CHECKING:
    from robocasa_lerobot.convert.render import Scene


class Episode:
    """A demo seen through a plan; use it in a `with` block (it may hold a compiled scene).

    Its scene is taken from `ahead`, if that has it.

    Attributes: `actions` (T, A) and `states` (T, S) float64 in stored order, `extras` (feature name -> (T, k) float64),
    `instruction`, `stages` (where the dataset has them), `provenance` (MimicGen's), `state_source`, and
    `simulator_states` (T, 1 + nq + nv) or None.

    Raises:
        RejectedEpisodeError: anything about this demo that keeps it from being converted.
        MissingAssetsError: meshes or textures of its scene were not found.
    """

    def __init__(self, file: DemoFile, name: str, plan: Plan, ahead: ScenesAhead | None = None) -> None:
        self.demo = file.demo(name)
        self.actions = plan.mapping.actions(self.demo)
        settings = plan.settings
        try:
            self.instruction = instruction_of(self.demo, file, settings.instruction, settings.replace_instruction)
        except UserError as error:  # a field or text that this episode lacks; the first one of its file has it
            raise RejectedEpisodeError(str(error)) from None
        self.extras = plan.mapping.extras(self.demo)
        self.provenance = self.demo.provenance
        self.stages = stages_of(self.demo, self.instruction.text) if plan.stages else None
        self.cameras = plan.cameras
        self._scene: Scene | None = None
        self._stack = ExitStack()
        # Everything that is written is read or looked at here, so that no mistake is found after half of the writing.
        self.simulator_states = self.demo.states
        names = [camera.name for camera in plan.cameras]
        for camera in plan.cameras:
            if camera.name in self.demo.image_cameras:
                size, wanted = self.demo.image_shape(camera.name), (camera.height, camera.width)
                if settings.image_size is None and size != wanted:
                    raise RejectedEpisodeError(
                        f"its pictures of {camera.name} are {size[0]}x{size[1]}, those of other episodes "
                        f"{wanted[0]}x{wanted[1]}. Convert it by itself (--demos), or all to one size (--image-size)."
                    )
        recorded = plan.mapping.recorded_states(self.demo)
        if needs_scene(self.demo, plan.mapping, names):
            self._scene = self._stack.enter_context(self._load(file, plan, ahead))
        self.state_source = "observations" if recorded is not None else "computed from simulator states"
        try:
            self.states = recorded if recorded is not None else self._computed_states(plan)
        except BaseException:
            self._stack.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    @property
    def length(self) -> int:
        """Number of steps."""
        return self.demo.length

    @property
    def has_scene(self) -> bool:
        """Whether its scene is needed, and is there."""
        return self._scene is not None

    @property
    def rendered_cameras(self) -> tuple[str, ...]:
        """Cameras whose pictures are rendered, the others being stored in the file."""
        return tuple(camera.name for camera in self.cameras if camera.name not in self.demo.image_cameras)

    def pictures(self) -> Iterator[dict[str, NDArray[np.uint8]]]:
        """For each step in order, the picture (H, W, 3) of each camera."""
        stored = {c.name: self.demo.images(c.name) for c in self.cameras if c.name not in self.rendered_cameras}
        for step in range(self.length):
            yield self._pictures(step, {name: next(images) for name, images in stored.items()}, self.cameras)

    def pictures_at(self, step: int) -> dict[str, NDArray[np.uint8]]:
        """The picture (H, W, 3) of each camera at one step."""
        stored = {c.name: self.demo.image(c.name, step) for c in self.cameras if c.name not in self.rendered_cameras}
        return self._pictures(step, stored, self.cameras)

    def _pictures(
        self, step: int, stored: Mapping[str, NDArray[np.uint8]], cameras: Sequence[Camera]
    ) -> dict[str, NDArray[np.uint8]]:
        pictures = {c.name: _resized(stored[c.name], c.height, c.width) for c in cameras if c.name in stored}
        rendered = [camera for camera in cameras if camera.name not in stored]
        if rendered:
            assert self._scene is not None
            self._set_state(step)
            pictures |= self._scene.pictures(rendered)
        return {camera.name: pictures[camera.name] for camera in cameras}

    def _load(self, file: DemoFile, plan: Plan, ahead: ScenesAhead | None) -> Scene:
        # MuJoCo is not needed where the file has everything.
        from robocasa_lerobot.convert.render import Scene
        from robocasa_lerobot.convert.scenes.compiled import CompiledScene

        if self.demo.model_xml is None or self.simulator_states is None:
            lacking = "model_file" if self.demo.model_xml is None else "states"
            raise RejectedEpisodeError(f"it has no {lacking}, so nothing can be rendered.")
        source = DemoScene.of(plan, file.path, self.demo.name)
        compiled = ahead.take(source) if ahead is not None else None
        if compiled is None:
            compiled = CompiledScene.of(*source.read(file, self.demo), preset=plan.settings.render_preset)
        scene = Scene(compiled)
        missing = [name for name in self.rendered_cameras if name not in scene.camera_names]
        if missing:
            scene.close()
            raise RejectedEpisodeError(
                f"its scene has no camera {missing[0]!r} (it has {', '.join(scene.camera_names)})."
            )
        return scene

    def _set_state(self, step: int) -> None:
        assert self._scene is not None
        assert self.simulator_states is not None
        self._scene.set_state(self.simulator_states[step])

    def _computed_states(self, plan: Plan) -> NDArray[np.float64]:
        assert self._scene is not None
        states = []
        for step in range(self.length):
            self._set_state(step)
            try:
                states.append(plan.mapping.state_of_scene(self._scene))
            except KeyError as error:
                raise RejectedEpisodeError(f"its scene lacks what the state is computed from: {error}") from None
            except np.linalg.LinAlgError:
                raise RejectedEpisodeError(f"its scene falls apart at step {step}: poses are not finite.") from None
            if not np.isfinite(states[-1]).all():
                raise RejectedEpisodeError(f"its scene falls apart at step {step}: poses are not finite.")
        return np.stack(states)


def _resized(picture: NDArray[np.uint8], height: int, width: int) -> NDArray[np.uint8]:
    if picture.shape[:2] == (height, width):
        return picture
    from PIL import Image

    return np.asarray(Image.fromarray(picture).resize((width, height), Image.Resampling.LANCZOS))
