"""The sweep of composite tasks over kitchens: each gets its kitchens, what is unsound is told, a kill costs little."""

from __future__ import annotations

import importlib
import json
from collections import Counter
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from robocasa_lerobot.envs.kitchens.splits import scene_ids


@pytest.fixture(scope="module")
def sweep() -> ModuleType:
    return importlib.import_module("kitchen_tasks")


def test_rare_tasks_are_drawn_as_often_as_others(sweep: ModuleType) -> None:
    pairs, names = scene_ids("target") + scene_ids("pretrain"), sweep.composites()
    tasks_of = sweep.suited(pairs, names)
    order = sweep.orders(tasks_of)
    assert order == sweep.orders(tasks_of)
    drawn = Counter(name for tasks in order.values() for name in tasks[: sweep.IN_EACH])
    assert set(drawn) == set(names)
    assert max(drawn.values()) < 3 * min(drawn.values())
    assert all(set(tasks) <= set(tasks_of[pair]) and len(tasks) == len(set(tasks)) for pair, tasks in order.items())


def test_it_goes_on_and_gives_every_task_its_kitchens(
    sweep: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[tuple[Any, str]] = []

    def arrange(pair: tuple[int, int], name: str) -> dict[str, Any]:
        made.append((pair, name))
        row = {"layout": pair[0], "style": pair[1], "split": "pretrain", "task": name}
        return row | ({"refused": "no room"} if name == "KettleBoiling" and pair[1] % 2 else {"fell": {}})

    monkeypatch.setattr(sweep, "arrange", arrange)
    pairs, names = scene_ids("pretrain")[:40], ["KettleBoiling", "WashLettuce", "PreSoakPan"]
    parts = tmp_path / "parts.jsonl"
    monkeypatch.setattr(sweep, "IN_EACH", 1)
    rows = sweep.sweep(pairs, names, parts, 1, least=15)
    arranged = Counter(row["task"] for row in rows if "refused" not in row)
    assert min(arranged.values()) >= 15
    assert len(made) == len(set(made)) == len(rows)
    whole = parts.read_text().splitlines(keepends=True)
    parts.write_text("".join(whole[:-4]) + whole[-1][:20])
    again = sweep.sweep(pairs, names, parts, 1, least=15)
    assert len(made) <= len(rows) + 8
    assert Counter(row["task"] for row in again if "refused" not in row) >= Counter(dict.fromkeys(names, 15))


def test_a_kitchen_of_which_half_was_written_is_finished(sweep: ModuleType) -> None:
    def row(pair: tuple[int, int], task: str, **more: object) -> dict[str, Any]:
        return {"layout": pair[0], "style": pair[1], "task": task, "extra": False, **more}

    new, half, done, hopeless = (1, 1), (1, 2), (1, 3), (1, 4)
    names = ["A", "B", "C", "D", "E", "F"]
    rows = [row(half, "A"), row(half, "B", refused="no room"), row(new, "A", extra=True)]
    rows += [row(done, name) for name in names[:5]] + [row(hopeless, name, refused="no room") for name in names]
    order = dict.fromkeys((new, half, done, hopeless), names)
    found = sweep.begun(rows, list(order), order)
    assert found == [(new, names, 5), (half, ["C", "D", "E", "F"], 4)]


@pytest.mark.parametrize("fault", ["error", "fell", "moved", "sunk", "blocked"])
def test_every_fault_counts(sweep: ModuleType, fault: str) -> None:
    good = {"layout": 1, "style": 1, "task": "A", "fell": {}, "moved": {}, "sunk": [], "blocked": []}
    body = sweep.summary([good, good | {"style": 2, fault: {"x": 1}}, good | {"style": 3, "refused": "no"}], ["A"])
    assert (body["arrangements"], body["sound"], body["faults"][fault]) == (2, 1, 1)
    assert body["tasks"]["A"] == {"tried": 3, "arranged": 2, "unsound": 1}
    assert json.dumps(body)


def test_one_task_in_one_kitchen(sweep: ModuleType) -> None:
    row = sweep.arrange((12, 51), "WarmCroissant")
    assert sweep.is_sound(row)
    assert set(row) >= {"fell", "moved", "sunk", "blocked"}
    refused = sweep.arrange((20, 51), "GarnishCupcake")
    assert "no arrangement" in refused["refused"]
