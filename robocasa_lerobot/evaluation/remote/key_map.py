"""Key maps: under which names, in which order and size a server takes observations and gives actions.

A YAML file, one of the package's presets or a user's own:

    about: what serves it, and where the names come from
    cameras:                      # pictures, uint8 (H, W, 3), upright RGB
      - {camera: robot0_agentview_left, key: observation/image, size: [224, 224], resize: pad}
    state:                        # parts of our state, concatenated in this order
      - {key: observation/state, parts: [end_effector_position_relative, gripper_qpos]}
    prompt: {key: prompt}
    actions:                      # parts of our action, as they lie in an array of the answer
      - {key: actions, parts: [end_effector_position, end_effector_rotation, gripper_close, base_motion, control_mode]}
    executed_steps: 5
    picture_offsets: [-6, -4, -2, 0]

A key `a > b` is b inside the map a; any other character belongs to the name.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.evaluation.remote.address import DEFAULT_PORTS
from robocasa_lerobot.settings import Data, check_keys, decode, load_yaml

AUTO = "auto"  # not a file: made from what the server says about itself
RESIZES = ("pad", "stretch", "none")
AXES = ("none", "time", "batch_time")
FORMS = ("text", "list", "lists")
DTYPES = ("float32", "float64")
_PRESETS = Path(__file__).parent / "presets"
_STATE_SIZES = {part.name: part.size for part in contract.STATE_PARTS}
_ACTION_SIZES = {part.name: part.size for part in contract.ACTION_PARTS}


@dataclass(frozen=True)
class CameraKey:
    """Where a camera's picture goes. `size` is (height, width) in pixels, None as rendered.

    `resize`: `pad` keeps the aspect and fills up with black, `stretch` does not, both with Pillow's bilinear filter, as
    openpi's clients do; `none` sends only pictures that have the size.
    """

    key: str
    camera: str
    size: list[int] | None = None
    resize: str = "pad"


@dataclass(frozen=True)
class StateKey:
    """Where parts of the state go, concatenated in this order."""

    key: str
    parts: list[str]
    dtype: str = "float32"


@dataclass(frozen=True)
class PromptKey:
    """Where the instruction goes: as `text`, as a `list` of one, or as `lists`, a list of a list of one."""

    key: str
    form: str = "text"


@dataclass(frozen=True)
class ActionKey:
    """Where action parts come from: components `start` on of an array whose last axis has `width` components.

    Without a width the parts must fill the array.
    """

    key: str
    parts: list[str]
    start: int = 0
    width: int | None = None

    @property
    def end(self) -> int:
        """The component after the last one that is read."""
        return self.start + sum(_ACTION_SIZES[part] for part in self.parts)


@dataclass(frozen=True)
class KeyMap:
    """What a server takes and gives; see the module's docstring for the file.

    Attributes:
        protocol: the only one that it is for; None: any.
        executed_steps: of each answer; the answer must have at least as many.
        picture_offsets: control steps of the pictures of a request, ascending up to 0, such as [-6, -4, -2, 0]; before
            an episode's start its first observation counts.
        state_offsets: those of the states; None: the same.
        axes: in front of pictures (H, W, 3) and states (D): `none`, `time` or `batch_time`.
        image_size: pixels, height and width, at which the env renders.
        constants: further entries of every request.
        reset: what is sent at an episode's start, where the protocol has no word for it or takes more with it.
        seed: key of the seed of the trial's noise, for servers that take one; outcomes then repeat.
        number: key of the number of the request in its trial, likewise.
    """

    actions: list[ActionKey]
    about: str = ""
    protocol: str | None = None
    cameras: list[CameraKey] = field(default_factory=list)
    state: list[StateKey] = field(default_factory=list)
    prompt: PromptKey | None = None
    executed_steps: int = 1
    picture_offsets: list[int] = field(default_factory=lambda: [0])
    state_offsets: list[int] | None = None
    axes: str = "none"
    image_size: int = contract.IMAGE_SIZE
    constants: dict[str, Any] = field(default_factory=dict)
    reset: dict[str, Any] | None = None
    seed: str | None = None
    number: str | None = None

    def __post_init__(self) -> None:
        """Check what can be checked without a server.

        Raises:
            UserError: unknown names, action parts that are missing or come twice, offsets that are no history.
        """
        names: list[tuple[str, str, Iterable[str]]] = [
            *(("camera", one.camera, contract.CAMERAS) for one in self.cameras),
            *(("resize rule", one.resize, RESIZES) for one in self.cameras),
            *(("state part", part, _STATE_SIZES) for one in self.state for part in one.parts),
            *(("dtype", one.dtype, DTYPES) for one in self.state),
            *(("action part", part, _ACTION_SIZES) for one in self.actions for part in one.parts),
            ("axes", self.axes, AXES),
            ("form of the prompt", self.prompt.form if self.prompt else FORMS[0], FORMS),
        ]
        if self.protocol is not None:
            names.append(("protocol", self.protocol, DEFAULT_PORTS))
        for kind, name, known in names:
            if name not in known:
                raise UnknownNameError(kind, name, known, "(in a key map)")
        self._check_actions()
        self._check_numbers()
        keys = self.sent_keys
        twice = sorted({key for key in keys if keys.count(key) > 1})
        if twice:
            raise UserError(f"a key map sends two things under {', '.join(twice)}; give each a key of its own.")

    @property
    def offsets(self) -> tuple[int, ...]:
        """Control steps of all observations that a request is made of, ascending."""
        return tuple(sorted({*self.picture_offsets, *self.of_states}))

    @property
    def of_states(self) -> list[int]:
        """Control steps of the states of a request."""
        return self.picture_offsets if self.state_offsets is None else self.state_offsets

    @property
    def sent_keys(self) -> list[str]:
        """Keys of pictures, states and prompt in a request."""
        prompt = [self.prompt.key] if self.prompt is not None else []
        return [*(one.key for one in self.cameras), *(one.key for one in self.state), *prompt]

    @property
    def repeats(self) -> bool:
        """Whether the server is told what fixes its noise, so that a trial can be repeated."""
        return self.seed is not None

    def _check_actions(self) -> None:
        given = [part for one in self.actions for part in one.parts]
        missing = [part for part in _ACTION_SIZES if part not in given]
        twice = sorted({part for part in given if given.count(part) > 1})
        if missing or twice:
            what = f"lacks {', '.join(missing)}" if missing else f"has {', '.join(twice)} twice"
            raise UserError(f"actions of a key map: found one that {what}; expected {', '.join(_ACTION_SIZES)}.")
        for one in self.actions:
            if one.start < 0 or (one.width is not None and one.width < one.end):
                raise UserError(f"actions of a key map: {one.key} has width {one.width}, its parts end at {one.end}.")

    def _check_numbers(self) -> None:
        for name, offsets in (("picture_offsets", self.picture_offsets), ("state_offsets", self.of_states)):
            if not offsets or offsets[-1] != 0 or sorted(set(offsets)) != list(offsets):
                raise UserError(f"{name}: found {offsets}, expected ascending steps up to 0, as [-6, -4, -2, 0].")
            if self.axes == "none" and len(offsets) > 1:
                raise UserError(f"{name}: found {offsets} with axes none; a history needs `axes: time` or batch_time.")
        if self.executed_steps < 1 or self.image_size < 16:
            raise UserError("a key map needs executed_steps of at least 1 and an image_size of at least 16.")
        for one in self.cameras:
            if one.size is not None and (len(one.size) != 2 or min(one.size) < 1):
                raise UserError(f"{one.key}: found size {one.size}, expected [height, width] in pixels.")


def presets() -> list[str]:
    """Names of the package's key maps."""
    return sorted(path.stem for path in _PRESETS.glob("*.yaml"))


def load_key_map(name: str) -> KeyMap:
    """A preset by its name, or the key map in a file.

    Raises:
        UserError: neither is there, or it is no key map; the closest name is told.
    """
    path = _PRESETS / f"{name}.yaml" if name in presets() else Path(name)
    if not path.is_file():
        raise UnknownNameError("key map", name, [*presets(), AUTO], "(or give the path of a YAML file)")
    return from_tree(load_yaml(path), str(path) if path.parent != _PRESETS else name)


def from_tree(tree: Data, where: str) -> KeyMap:
    """A key map from its mapping.

    Raises:
        UserError: an unknown key or a value that does not fit.
    """
    check_keys(KeyMap, tree, where)
    return decode(KeyMap, tree, where)


def with_executed(key_map: KeyMap, executed_steps: int | None) -> KeyMap:
    """The map with other executed steps, None for its own."""
    return key_map if executed_steps is None else dataclasses.replace(key_map, executed_steps=executed_steps)


def path_of(key: str) -> Sequence[str]:
    """The names from the outermost map inwards."""
    return [name.strip() for name in key.split(" > ")]
