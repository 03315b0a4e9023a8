"""MimicGen's templates: which subtasks a task has, what each is relative to, and where it ends.

The names of fields, and what they are where a template does not say, are those of MimicGen's library; RoboCasa's own
templates set `select_src_per_subtask` and `transform_first_robot_pose`.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robocasa_lerobot.demos.generate.mimicgen.refs import ref_of, refs_of
from robocasa_lerobot.demos.generate.sources.segments import PLACE, USE
from robocasa_lerobot.demos.generate.sources.source import Source, UnfitSourcesError
from robocasa_lerobot.errors import UnknownNameError, UserError

RANDOM, OBJECT, ROBOT, INTERPOLATION = STRATEGIES = (
    "random",
    "nearest_neighbor_object",
    "nearest_neighbor_robot_distance",
    "nearest_neighbor_interpolation",
)
NEAREST = {OBJECT: 3, ROBOT: 3, INTERPOLATION: 1}  # how many come into question, where a template does not say
ROBOCASA_NEAREST = 5  # RoboCasa's own number, of `INTERPOLATION`


@dataclass(frozen=True)
class Subtask:
    """A part of a demonstration that is carried over as a whole.

    Attributes:
        object_ref: name of what it is relative to; None leaves it as it was.
        signal: whose first rise ends it; None of the last, which ends with the demonstration.
        offsets: steps after that rise, drawn evenly between two numbers.
        selection: how its source is chosen.
        neighbours: among how many of the nearest; 0 as `NEAREST` says.
        action_noise: standard deviation on the arm's commands, 1 is a full one.
        interpolation_steps: on the line to its first pose.
        fixed_steps: that its first pose is held.
        noise_on_the_line: whether the noise is on these, too.
        stage: number of the task's stage that it is part of; templates do not say it: the first is taken.
        weights: of metres and of radians, where the nearest are looked for.
    """

    object_ref: str | None
    signal: str | None
    offsets: tuple[int, int] = (0, 0)
    selection: str = RANDOM
    neighbours: int = 0
    action_noise: float = 0.0
    interpolation_steps: int = 5
    fixed_steps: int = 0
    noise_on_the_line: bool = False
    stage: int = 0
    weights: tuple[float, float] = (1.0, 1.0)


@dataclass(frozen=True)
class Template:
    """Of a task.

    Attributes:
        subtasks: in order.
        per_subtask: whether each takes a source of its own, else one serves the episode.
        first_pose: whether the hand's first pose in a subtask is led to, before its targets; of the first it always is.
        from_last_target: whether a line begins at the last target, else where the hand is.
    """

    subtasks: tuple[Subtask, ...]
    per_subtask: bool = False
    first_pose: bool = False
    from_last_target: bool = True


def read_json_template(path: Path) -> Any:
    """Read one of MimicGen's JSON files, as plain values of which `template_from` makes a template.

    Raises:
        UserError: it is no such file, or says what cannot be.
        UnknownNameError: there is no such way of selecting.
    """
    try:
        asked = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:  # also what is no text
        raise UserError(f"{path} cannot be read as JSON ({error}).") from error
    template_from(asked, str(path))
    return asked


def template_from(asked: Any, where: str = "template") -> Template:
    """A template from plain values.

    Raises:
        UserError, UnknownNameError: see `read_json_template`.
    """
    specs = _inside(_inside(asked, "task"), "task_spec")
    if not isinstance(specs, dict) or not specs:
        raise UserError(f"{where} has no `task.task_spec` with subtasks; MimicGen's own templates have.")
    named = [(name, spec) for name, spec in specs.items() if spec]
    for name, spec in named:
        if not isinstance(spec, dict):
            raise UserError(f"{where}, {name}: found {spec!r}, expected the settings of a subtask.")
    if not named:
        raise UserError(
            f"{where} leaves its subtasks to RoboCasa's own code: they are empty here. Leave --template out to have "
            "them derived from the sources."
        )
    subtasks = tuple(_subtask(f"{where}, {name}", spec, last=spec is named[-1][1]) for name, spec in named)
    generation = _inside(_inside(asked, "experiment"), "generation")
    generation = generation if isinstance(generation, dict) else {}
    return Template(
        subtasks,
        per_subtask=bool(generation.get("select_src_per_subtask", False)),
        first_pose=bool(generation.get("transform_first_robot_pose", False)),
        from_last_target=bool(generation.get("interpolate_from_last_target_pose", True)),
    )


def _inside(values: Any, key: str) -> Any:
    """What an object of JSON has under a key; None where it has not, or is no object."""
    return values.get(key) if isinstance(values, dict) else None


def _subtask(where: str, spec: Mapping[str, Any], *, last: bool) -> Subtask:
    selection = str(spec.get("selection_strategy") or RANDOM)
    if selection not in STRATEGIES:
        raise UnknownNameError("way of selecting a source", selection, STRATEGIES)
    signal, low_high = spec.get("subtask_term_signal"), spec.get("subtask_term_offset_range") or (0, 0)
    if (signal is None) != last:
        raise UserError(f"{where}: every subtask but the last names a subtask_term_signal, and the last none.")
    if len(low_high) != 2 or low_high[0] > low_high[1]:
        raise UserError(f"{where}: subtask_term_offset_range is {low_high}, expected two rising numbers.")
    ref = spec.get("object_ref")
    if ref is None and selection != RANDOM:
        raise UserError(f"{where}: without an object_ref a source can only be chosen at random, not by {selection}.")
    chosen = spec.get("selection_strategy_kwargs") or {}
    if unknown := sorted(set(chosen) - {"nn_k", "pos_weight", "rot_weight"}):
        raise UnknownNameError(f"{where}: selection_strategy_kwargs", unknown[0], ["nn_k", "pos_weight", "rot_weight"])
    return Subtask(
        object_ref=ref,
        signal=signal,
        offsets=(int(low_high[0]), int(low_high[1])),
        selection=selection,
        neighbours=int(chosen.get("nn_k", 0)),
        action_noise=float(spec.get("action_noise", 0.0)),
        interpolation_steps=int(spec.get("num_interpolation_steps", 5)),
        fixed_steps=int(spec.get("num_fixed_steps", 0)),
        noise_on_the_line=bool(spec.get("apply_noise_during_interpolation", False)),
        weights=(float(chosen.get("pos_weight", 1.0)), float(chosen.get("rot_weight", 1.0))),
    )


def derived_signal(number: int, kind: str) -> str:
    """Name of the signal that ends a derived subtask, of whatever part or object."""
    return f"{number}_{kind}"


def derived_template(sources: Sequence[Source]) -> tuple[Template, list[Source]]:
    """What RoboCasa's tasks have, from the segments of prepared sources, and those sources that it is for.

    A subtask for each segment, relative to its part or object, or to what an object is put onto or into or used on; of
    sources with other sequences of segments the most frequent one counts. Other than RoboCasa's, a subtask ends where
    an object is lifted or a part let go, and not 5 to 20 steps after its first touch, a line begins where the hand is
    and not at the last target, and there is no noise but what is asked for: all of which helps.

    Raises:
        UnfitSourcesError: no source has a segment.
    """

    def kinds(source: Source) -> tuple[tuple[str, str], ...]:
        return tuple((one.kind, ref_of(source, one)) for one in source.segments)

    sequences = Counter(kinds(source) for source in sources if source.segments)
    if not sequences:
        tasks = ", ".join(sorted({source.task for source in sources}))
        raise UnfitSourcesError(
            f"in none of the {len(sources)} sources ({tasks}) the hand moves anything: there are no subtasks to carry "
            "over. Choose another --method."
        )
    usual, _ = sequences.most_common(1)[0]
    alike = [source for source in sources if kinds(source) == usual]
    model, subtasks = alike[0], []
    known = refs_of(model)
    for number, one in enumerate(model.segments):
        words, place = model.data.about["stages"][one.stage], f"stage{one.stage}.place"
        last = number == len(model.segments) - 1
        signal = None if last else derived_signal(number, one.kind)
        elsewhere = one.kind == PLACE or (one.kind == USE and not words["about_itself"])
        ref = place if elsewhere and place in known else ref_of(model, one)
        subtasks.append(Subtask(ref, signal, selection=INTERPOLATION, neighbours=ROBOCASA_NEAREST, stage=one.stage))
    return Template(tuple(subtasks), per_subtask=True, first_pose=True, from_last_target=False), alike
