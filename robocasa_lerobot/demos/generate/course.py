"""What a generated episode keeps of itself while it runs: choices at random, and where each step comes from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.demos.generate.select import Manner
from robocasa_lerobot.demos.generate.sources.source import Piece, Source
from robocasa_lerobot.demos.motion import OPEN, Array
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Stage

FREE, CONTACT, BRIDGE, DRIVE, SETTLE = range(5)  # kinds of steps
MOST_SOURCES = 24  # that are asked for a stage: more than one task usually has
OTHER_KIND_COST = 0.15  # of a segment from a stage that puts things into another kind of fixture, or onto an object
NOT_DRAWN_COST = 0.5  # as of a hand that touches something: see `planning/costs.py`
LATER_COST = 0.15  # more for each further draw, so that it is not always the same source that steps in
AT_REST = (-1, BRIDGE, -1)  # label of steps in which it is waited
_BASE, _GRIPPER = contract.ACTION_SLICES["base_motion"], contract.ACTION_SLICES["gripper_close"].start
KINDS = ("free", "contact", "bridge", "drive", "settle")


class Try(NamedTuple):
    """What tells one try at moving a part from another: source, step of its contact, part, and how it was turned."""

    source: int
    contact: int
    part: str
    mirror: bool
    flip: bool


@dataclass
class Course:
    """A running episode.

    Attributes:
        sources: it may take segments from.
        rng: of its choices.
        manner: how segments are chosen and joined.
        spread: cost that a source may have at random, so that the same one is not always taken.
        cap: share of an average demonstration's segments that one source should have at most; see `source_costs`.
        label: source, kind of step, and step in the source, of the action that comes next.
        labels: of all actions so far.
        fingers: their command in the last one.
        used: the segments that were carried out, in plain values.
        clean: actions before the noise of a template; of others empty.
        failed: of the parts that stages are about, what has come to nothing so far, and how often.
        rest: rotation (3, 3) of each object before it was touched.
        lay: upright pose (4, 4) of where each object lay before it was taken last; see `sources.uses`.
    """

    sources: list[Source]
    rng: np.random.Generator
    manner: Manner
    spread: float
    cap: float = 1.0
    label: tuple[int, int, int] = AT_REST
    labels: list[tuple[int, int, int]] = field(default_factory=list)
    fingers: float = OPEN
    used: list[dict[str, Any]] = field(default_factory=list)
    clean: list[Array] = field(default_factory=list)
    failed: dict[tuple[str, ...], Counter[Try]] = field(default_factory=dict)
    rest: dict[str, Array] = field(default_factory=dict)
    lay: dict[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.bias = source_costs([one.task for one in self.sources], self.rng, self.spread, self.cap)

    def most_alike(self, pieces: Sequence[Piece], env: KitchenEnv, stage: Stage) -> list[Piece]:
        """Those segments that are asked whether they fit a stage, where there are many, as of many tasks.

        Those of drawn sources come first, and those of stages about the same kind of fixture. Where the selection goes
        by distance or by chance, it has all to go by.
        """
        if self.manner.select != "feasible":
            return list(pieces)
        fixture = env.scene.roles.get(stage.target)
        wanted = type(env.scene.fixtures[fixture]).__name__ if fixture else ""

        def cost(piece: Piece) -> float:
            own = piece.data.about["fixtures"].get(piece.words["target"], {}).get("kind", "")
            return float(self.bias[piece.source.number]) + OTHER_KIND_COST * (own != wanted)

        numbers = dict.fromkeys(piece.source.number for piece in sorted(pieces, key=cost))
        asked = set(list(numbers)[:MOST_SOURCES])
        return [piece for piece in pieces if piece.source.number in asked]

    def begin(self, piece: Piece, **about: Any) -> dict[str, Any]:
        """Note that a segment is about to be carried out; what comes of it can be added to what is returned."""
        row = {
            "source": piece.source.name,
            "demo": piece.source.number,
            "kind": piece.segment.kind,
            "ref": piece.segment.ref,
            "steps": [piece.segment.lead, piece.segment.end],
            **about,
        }
        self.used.append(row)
        return row

    def labelled(self, steps: Iterator[Array], kind: int) -> Iterator[Array]:
        """Actions as steps of one kind that come from no source."""
        for step in steps:
            self.label = (-1, kind, -1)
            yield step

    def choosing[T](self, steps: Generator[Array, None, T], kind: int) -> Generator[Array, None, T]:
        """The same; returns what they return."""
        while True:
            self.label = (-1, kind, -1)
            try:
                step = next(steps)
            except StopIteration as end:
                chosen: T = end.value
                return chosen
            yield step

    def counted(self, steps: Iterator[Array]) -> Iterator[Array]:
        """All actions of the episode, each with its label kept; what drives between segments says so."""
        for step in steps:
            drives = self.label == AT_REST and bool(np.any(step[_BASE]))
            self.labels.append((-1, DRIVE, -1) if drives else self.label)
            self.fingers = float(step[_GRIPPER])
            yield step


def source_costs(tasks: Sequence[str], rng: np.random.Generator, spread: float, cap: float) -> Array:
    """What it costs in an episode to take a segment of each source, by its number.

    An episode is a function of its seed and knows nothing of the others: so that none of a task's N sources has more
    than its share, `cap` times N of them are drawn, and the others are only for what these cannot do: first those that
    are drawn next, as many again, and so on, so that what few sources can do is spread over these few.

    Args:
        tasks: that the sources solve, by their numbers.
        rng: of the draw.
        spread: cost that each has at random, at most.
        cap: share that is drawn.
    """
    bias: Array = rng.uniform(0.0, spread, size=len(tasks))
    for task in dict.fromkeys(tasks):
        mine = np.array([number for number, other in enumerate(tasks) if other == task], dtype=np.int64)
        share = max(1, int(np.floor(cap * len(mine) + 1e-9)))
        draw = np.arange(len(mine)) // share
        bias[rng.permutation(mine)] += np.where(draw > 0, NOT_DRAWN_COST + LATER_COST * (draw - 1), 0.0)
    return bias
