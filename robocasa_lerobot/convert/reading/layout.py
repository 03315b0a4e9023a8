"""Where a demonstration file keeps its episodes, actions and pictures; all of it for files of unknown kinds."""

from __future__ import annotations

from dataclasses import dataclass

DEFAULT_EPISODES = "data/demo_*"
ACTIONS, ABSOLUTE_ACTIONS = ACTION_KEYS = ("actions", "actions_abs")
# How the stored rows and columns of a picture are turned to make it upright.
FLIPS = ("none", "vertical", "horizontal", "both")


@dataclass(frozen=True)
class Picture:
    """The HDF5 dataset (T, H, W, 3) uint8 of a camera below its episode, and how it is flipped to be upright."""

    key: str
    flip: str = "none"


@dataclass(frozen=True)
class PartColumns:
    """A part of the state or action: components `start` to `stop` of the dataset `key` below an episode.

    `stop` None means to the end. `components` are the names of the single numbers; empty means made from the part's.
    `constant` are the numbers of every step, instead of a dataset: what the user says of a part that the robot lacks.
    """

    name: str
    key: str
    start: int = 0
    stop: int | None = None
    components: tuple[str, ...] = ()
    constant: tuple[float, ...] = ()


@dataclass(frozen=True)
class InstructionSource:
    """Where an episode's language is: a text or template, an attribute (with a field if it is JSON), or a dataset."""

    text: str | None = None
    attribute: str | None = None
    field: str | None = None
    dataset: str | None = None


@dataclass(frozen=True)
class CustomRobot:
    """A robot as the user describes it in a mapping file; `cameras` are in the order of the dataset."""

    robot_type: str
    fps: int
    state: tuple[PartColumns, ...]
    action: tuple[PartColumns, ...]
    cameras: tuple[str, ...]
    instruction: InstructionSource = InstructionSource()


@dataclass(frozen=True)
class Layout:
    """How a file is read.

    Attributes:
        episodes: path of the episodes' groups, whose last component may hold `*`; `/` where the file is one episode.
        action_key: dataset below an episode whose length is the episode's.
        pictures: dataset of each stored camera; None means that of robomimic, `obs/<camera>_image`.
        extra_columns: further datasets below an episode that are kept as features of their own.
        robot: None means to recognise it.
        model_roots: folders for scenes that an episode names by file instead of holding them.
    """

    episodes: str = DEFAULT_EPISODES
    action_key: str = ACTION_KEYS[0]
    pictures: tuple[tuple[str, Picture], ...] | None = None
    extra_columns: tuple[str, ...] = ()
    robot: CustomRobot | None = None
    model_roots: tuple[str, ...] = ()


ROBOMIMIC = Layout()
