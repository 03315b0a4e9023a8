"""Numbers of the walk that can be told apart, and the cells of the published tables that each of them belongs to."""

from __future__ import annotations

import csv
import dataclasses
import fnmatch
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.benchmark.tasks import published_task_sets
from robocasa_lerobot.evaluation.records.results import TRIALS_FILE, UNPERTURBED, Results, TrialRecord, read_results

TRIALS = 97
SPLITS = ("atomic_seen", "composite_seen", "composite_unseen", "average")
FULL = "human300_mg60"
Cell = tuple[str, str, str]  # table, row, column

# Where the published text has the result of what an experiment trains: phase, table and column; the rows are the
# groups of tasks. Two more tables, of lifelong learning and of scenes, have the phase as their row (below).
_SHARES = ("10", "30", "100")
PLACES: dict[str, list[tuple[str, str, str]]] = {
    "multitask_diffusion_policy": [("multitask", "multi_task", "diffusion_policy")],
    "multitask_pi0": [("multitask", "multi_task", "pi0")],
    "multitask_pi05": [("multitask", "multi_task", "pi05")],
    "multitask_gr00t": [("multitask", "multi_task", "gr00t"), ("multitask", "low_rank", "full")],
    "multitask_gr00t_lora": [("multitask", "low_rank", "lora")],
    "joint_cotraining": [("joint", "joint_cotraining", "gr00t")],
    "foundation": [
        ("pretrain", "foundation", "pretraining"),
        *((f"*_{share}", "foundation", f"both_{share}") for share in _SHARES),
        *((f"*_{share}", "pretraining_composition", f"{FULL}_{share}") for share in ("10", "100")),
    ],
    "target_only": [
        *((f"*_{share}", "foundation", f"target_{share}") for share in _SHARES),
        *((f"*_{share}", "pretraining_composition", f"none_{share}") for share in ("10", "100")),
    ],
    **{
        f"composition_{name}": [(f"*_{share}", "pretraining_composition", f"{name}_{share}") for share in ("10", "100")]
        for name in ("human50", "human300")
    },
}
# What our own kitchens' experiments stand for, where it is not the one of the same name.
STANDS_FOR = {
    "small_multitask_flow_vla": "multitask_pi0",
    "small_multitask_flow_vla_adaptive": "multitask_pi05",
}
OWN_PLACES = {
    "small_multitask_act": [("multitask", "multi_task", "gr00t")],
    "small_multitask_diffusion_policy": [
        ("multitask", "multi_task", "diffusion_policy"),
        ("multitask", "low_rank", "full"),
    ],
    "small_multitask_lora": [("lora", "low_rank", "lora")],
    "small_lifelong_atomic": [],
}


def with_known_numbers(folders: Sequence[Path], out: Path) -> list[Path]:
    """The same runs with many trials instead of one, of which each task of each policy has its own share of successes.

    Headers, policies and tasks stay as the walk left them, so that a report places them by what the runs say.
    """
    written = []
    for number, folder in enumerate(folders):
        results = read_results(folder)
        target = out / f"{number}_{folder.name}"
        target.mkdir(parents=True)
        (target / TRIALS_FILE).write_text("\n".join(_lines(results)) + "\n", encoding="utf-8")
        written.append(target)
    return written


def _lines(results: Results) -> Iterator[str]:
    headers = {key: dataclasses.replace(header, trials=TRIALS) for key, header in results.headers.items()}
    yield from (header.to_line() for header in headers.values())
    for record in results.trials:
        solved = successes(record)
        for trial in range(TRIALS):
            first = 1 if trial < solved else None
            changes = {"run": headers[record.run].id, "trial": trial, "success": first is not None}
            yield dataclasses.replace(record, **changes, first_success_step=first, video=None).to_line()


def successes(record: TrialRecord) -> int:
    """Of TRIALS: a number of its own for each policy, task and perturbation."""
    return zlib.crc32("|".join((record.label, record.task, record.perturbation)).encode()) % (TRIALS + 1)


def expected_cells(folders: Sequence[Path]) -> dict[tuple[Cell, str], float]:
    """For each cell and policy the percentage that a report has to show there, from the runs and the tables above."""
    found: dict[tuple[Cell, str], float] = {}
    for folder in folders:
        results = read_results(folder)
        rates: dict[str, dict[str, float]] = {}
        for record in results.trials:
            if record.perturbation == UNPERTURBED:
                rates.setdefault(record.label, {})[record.task] = 100 * successes(record) / TRIALS
        for header in results.headers.values():
            for label, info in header.policies.items():
                where = _places(str(info.experiment), str(info.phase), header.protocol)
                for cell, tasks in where:
                    own = [rate for task, rate in rates[label].items() if task in tasks]
                    if own:
                        found[cell, label] = sum(own) / len(own)
    return found


def _places(experiment: str, phase: str, protocol: str) -> Iterator[tuple[Cell, Sequence[str]]]:
    sets = published_task_sets()
    plain = STANDS_FOR.get(experiment, experiment.removeprefix("small_"))
    for pattern, table, column in OWN_PLACES.get(experiment, PLACES.get(plain, [])):
        if fnmatch.fnmatchcase(phase, pattern) and protocol != "robustness":
            yield from (((table, row, column), sets["target50" if row == "average" else row]) for row in SPLITS)
    if plain == "foundation" and phase.endswith("_100") and protocol == "foundation":
        yield from ((("per_task", task, "best"), (task,)) for task in published.per_task_rates())
    if plain == "lifelong":
        number = int(phase.removeprefix("phase"))
        for earlier in range(1, number + 1):
            name = f"lifelong_phase{earlier}"
            yield ("lifelong", str(number), name), sets[name]
    if plain.startswith("scene_diversity_"):
        row = {"pretrain": "zero_shot", "atomic_10": "target_10"}[phase]
        yield ("scene_diversity", row, plain.removeprefix("scene_diversity_")), sets["diversity17"]


def shown_cells(path: Path) -> dict[tuple[Cell, str], float]:
    """What a report's CSV of the published tables has of ours; of joined policies each counts with the joint number."""
    found: dict[tuple[Cell, str], float] = {}
    with path.open(encoding="utf-8") as file:
        for line in csv.DictReader(file):
            for label in filter(None, line["policies"].split("; ")):
                value = float(line["ours"] or line["partial"])
                found[(line["table"], line["row"], line["column"]), label] = value
    return found
