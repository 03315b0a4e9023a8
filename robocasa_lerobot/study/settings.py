"""A study as typed configuration: questions, the experiments that answer them, and the rows of their tables.

`configs/study.yaml` is the package's own.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from robocasa_lerobot.config_files import configs_folder
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.settings import check_keys, decode, load_yaml

EXPERIMENTS = "study"  # folder in configs/experiments/
FILE = "study.yaml"
_AFTER = ", after phase "


@dataclass(frozen=True)
class RowConfig:
    """A row of a table: the trials of one evaluation of a phase, over all seeds.

    Attributes:
        experiment: file in `configs/experiments/study/`, without its ending.
        phase: of the experiment.
        evaluation: of the phase, by the name of its file.
        seeds: trainings of the experiment, where that is more than its part has.
    """

    experiment: str
    phase: str
    evaluation: str
    seeds: int | None = None


@dataclass(frozen=True)
class PartConfig:
    """A question and its table.

    Attributes:
        asks: the question.
        rows: by their labels, in order.
        sets: task sets of the registry, a column each.
        seeds: trainings of each experiment, with the seeds from 0 on.
        tasks: whether each task has a row in a table of its own.
        reference: row that all others are compared with.
        published: what the benchmark's paper found.
        matrix: whether the rows are phases of lifelong learning, `NAME, after phase K`, and the sets those phases'.
        on_request: whether the part is run only where it is named: it is not one of the study's questions.
    """

    asks: str
    rows: dict[str, RowConfig]
    sets: list[str]
    seeds: int = 3
    tasks: bool = False
    reference: str | None = None
    published: str = ""
    matrix: bool = False
    on_request: bool = False

    def __post_init__(self) -> None:
        if not self.rows or not self.sets or self.seeds < 1:
            raise UserError(f"part {self.asks!r}: expected rows, sets, and at least one seed.")
        if self.reference is not None and self.reference not in self.rows:
            raise UnknownNameError("row", self.reference, self.rows, f"(`reference` of the part {self.asks!r})")
        for row in self.rows if self.matrix else ():
            found = variant_of(row)
            if found is None or not 1 <= found[1] <= len(self.sets):
                raise UserError(
                    f"part {self.asks!r} has `matrix`, and a row {row!r}; expected `NAME{_AFTER}K` with a K from 1 to "
                    f"{len(self.sets)}, as many as its `sets`."
                )

    @property
    def experiments(self) -> tuple[str, ...]:
        """Names of its experiments, each once."""
        return tuple(dict.fromkeys(row.experiment for row in self.rows.values()))

    def seeds_of(self, experiment: str) -> int:
        """How many trainings of an experiment the part has."""
        own = [row.seeds for row in self.rows.values() if row.experiment == experiment and row.seeds is not None]
        return max([self.seeds, *own])

    def with_seeds(self, seeds: int) -> PartConfig:
        """The part with so many trainings of each experiment."""
        rows = {label: dataclasses.replace(row, seeds=None) for label, row in self.rows.items()}
        return dataclasses.replace(self, rows=rows, seeds=seeds)


@dataclass(frozen=True)
class StudyConfig:
    """A study file.

    Attributes:
        root: folder of the trainings.
        registry: of the data and task sets, counted from `configs/`.
        parts: by name, in the order in which they are run.
    """

    root: str
    registry: str
    parts: dict[str, PartConfig] = field(default_factory=dict)

    def chosen(self, names: Sequence[str], seeds: int | None = None) -> dict[str, PartConfig]:
        """The parts of these names, in the study's order; without names all but those on request.

        With `seeds` each has so many trainings.

        Raises:
            UnknownNameError: there is no such part.
        """
        for name in names:
            if name not in self.parts:
                raise UnknownNameError("part of the study", name, self.parts)
        own = {name: part for name, part in self.parts.items() if (name in names if names else not part.on_request)}
        return own if seeds is None else {name: part.with_seeds(seeds) for name, part in own.items()}

    def shown_with(self, parts: Mapping[str, PartConfig]) -> StudyConfig:
        """The study as its page shows it when `parts` are run: with its own seeds, and more where these have more.

        Fewer would take from the page what has been run before.
        """
        more = {
            name: dataclasses.replace(part, seeds=max(part.seeds, parts[name].seeds)) if name in parts else part
            for name, part in self.parts.items()
        }
        return dataclasses.replace(self, parts=more)


def variant_of(row: str) -> tuple[str, int] | None:
    """Name and phase of a row that is called `NAME, after phase K`; None for another one."""
    name, after, phase = row.rpartition(_AFTER)
    return (name, int(phase)) if after and phase.isdecimal() else None


def load_study(path: Path | None = None) -> StudyConfig:
    """The study of a file, the package's own by default.

    Raises:
        UserError: no such file, an unknown key, or a value that does not fit.
    """
    file = path or configs_folder() / FILE
    data = load_yaml(file)
    check_keys(StudyConfig, data, file.name)
    return decode(StudyConfig, data, str(file))
