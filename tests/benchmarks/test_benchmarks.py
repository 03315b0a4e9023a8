"""The benchmarks' own machinery; the figures are nobody's test."""

from __future__ import annotations

import ast
import importlib
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

REPOSITORY = Path(__file__).parents[2]
BENCHMARKS = REPOSITORY / "benchmarks"
RESULT = BENCHMARKS / "results" / "sim_speed.json"
SIMULATORS = ("robosuite", "ours")


@pytest.fixture(autouse=True)
def programs_on_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(BENCHMARKS)


def module(name: str) -> ModuleType:
    return importlib.import_module(name)


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.split(".")[0])
    return names


@pytest.mark.parametrize("path", sorted((BENCHMARKS / "peers").glob("*.py")), ids=lambda path: path.name)
def test_peers_import_nothing_of_ours(path: Path) -> None:
    known = {*sys.stdlib_module_names, "numpy", "mujoco", "sim_loop"}
    peers = {
        "robosuite": {"robosuite", "PIL", "h5py"},
        "robomimic": {"robomimic", "torch"},
        "policy": {"msgpack", "websockets", "zmq"},
    }
    assert imported(path) - known <= peers.get(path.name.split("_")[0], set())


@pytest.mark.parametrize("lock", sorted((BENCHMARKS / "requirements").glob("*.lock")), ids=lambda path: path.name)
def test_locks_are_pinned_by_hash_and_name_no_index(lock: Path) -> None:
    text = lock.read_text(encoding="utf-8")
    blocks = re.findall(r"^([\w.-]+)==\S+[^\n]*\\\n((?:    --hash=sha256:[0-9a-f]{64}(?: \\)?\n)+)", text, re.MULTILINE)
    assert len(blocks) == len(re.findall(r"^[^\s#]", text, re.MULTILINE)) > 0
    assert not re.search(r"--(?:extra-)?index-url|--find-links|https?://", text)


def test_robosuite_is_the_version_that_is_checked() -> None:
    text = (BENCHMARKS / "requirements" / "robosuite.lock").read_text(encoding="utf-8")
    for name, version in module("sim_speed").PEER_VERSIONS.items():
        assert f"\n{name}=={version} " in text
    said = {"robosuite": {"no_cameras": {"versions": {"robosuite": "1.5.1", "mujoco": "3.2.0", "numpy": "1"}}}}
    with pytest.raises(module("sim_speed").UserError, match=r"3\.2\.0"):
        module("sim_speed").check_peer(said)


def test_options() -> None:
    parse = module("sim_speed").parse
    assert parse([]).quick is parse([]).without_peer is False
    options = parse(["--quick", "--output", "x.json"])
    assert options.quick is True
    assert options.output == Path("x.json")
    with pytest.raises(SystemExit):
        parse(["--quickly"])


def test_actions_are_the_same_for_everybody() -> None:
    episode_actions = module("peers.sim_loop").episode_actions
    actions = episode_actions(3, 50)
    assert actions.shape == (50, 12)
    np.testing.assert_array_equal(actions, episode_actions(3, 50))
    assert (actions != episode_actions(4, 50)).any()
    assert set(actions[:, 6]) == {-1.0, 1.0}
    assert set(actions[:, 11]) == {-1.0}
    assert 0.2 < np.abs(np.delete(actions, (6, 11), axis=1)).max() <= 0.3
    standing = episode_actions(3, 50, standing=True)
    assert not standing[:, 7:11].any()
    np.testing.assert_array_equal(np.delete(standing, np.s_[7:11], axis=1), np.delete(actions, np.s_[7:11], axis=1))


@pytest.fixture(scope="module")
def workers() -> Iterator[list[Any]]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        worker = module("workers").Worker
        made = [worker(f"ours {i}", Path(sys.executable), BENCHMARKS / "ours_sim.py") for i in range(2)]
    for i, process in enumerate(made):
        process.said = process.ask("make", cameras=False, seed=i)
    yield made
    for process in made:
        process.close()


def test_our_env_is_a_full_kitchen_without_a_renderer(workers: list[Any]) -> None:
    said = workers[0].said
    assert said["cameras"] == []
    assert said["model"]["doors"] > 5
    assert said["model"]["drawers"] > 2
    assert said["model"]["objects"] >= 1
    assert said["control_hz"] * said["physics_timestep_s"] * 25 == pytest.approx(1.0)
    assert said["resident_mib"] > said["resident_after_import_mib"] > 50
    assert workers[0].startup_s > 0


def test_processes_step_together(workers: list[Any]) -> None:
    answers = module("workers").run_together(workers, 0.3, seed=40)
    for answer in answers:
        assert answer["steps"] >= 1
        assert 0 < answer["seconds"]


@pytest.mark.parametrize("same_scene", [False, True])
def test_resets_of_both_kinds(workers: list[Any], same_scene: bool) -> None:
    answer = workers[0].ask("resets", count=2, seed=60 + 10 * same_scene, same_scene=same_scene)
    assert len(answer["seconds"]) == 2
    assert all(seconds > 0 for seconds in answer["seconds"])


def test_a_reset_that_is_not_what_it_claims_is_an_error() -> None:
    """The env returns to the running scene when its seed is asked for: as a new scene, that would be cheating."""
    simulator = module("ours_sim").KitchenSimulator()
    simulator.make(cameras=False)
    simulator.reset(1, same_scene=False)
    with pytest.raises(RuntimeError, match="same_scene=False"):
        simulator.reset(1, same_scene=False)
    with pytest.raises(RuntimeError, match="same_scene=True"):
        simulator.reset(2, same_scene=True)


@pytest.mark.costly
@pytest.mark.render
def test_scenes_of_composite_tasks_are_measured(tmp_path: Path) -> None:
    sim = module("ours_tasks_sim")
    seeds = {sim.reset_seed(task, split, scene) for task in range(32) for split in range(2) for scene in range(3)}
    assert len(sim.TASKS) == 32
    assert len(seeds) == 32 * 2 * 3
    simulator = sim.TasksSimulator()
    simulator.make(cameras=False)
    simulator.reset(sim.reset_seed(5, 1, 100_400), same_scene=False)
    assert (simulator._env.task, simulator._env.split) == (sim.TASKS[5], "pretrain")
    with pytest.raises(RuntimeError, match="new scenes"):
        simulator.reset(0, same_scene=True)
    out = tmp_path / "task_scenes.json"
    arguments = ["--quick", "--tasks", "1", "--without-peer", "--out", str(out)]
    assert module("task_scenes").main(arguments) == 0
    result = json.loads(out.read_text())
    assert [(row["task"], row["split"]) for row in result["tasks"]] == [(sim.TASKS[0], s) for s in sim.SPLITS]
    assert result["reset_s"]["count"] == 2
    assert 0 < result["reset_s"]["median"] <= result["reset_s"]["p99"] <= result["reset_s"]["max"]
    assert result["steps_per_second"]["ours"] > 0


@pytest.mark.render
def test_parts_of_our_time_make_the_whole() -> None:
    simulator = module("ours_sim").KitchenSimulator()
    simulator.make(cameras=True)
    split = simulator.split(seed=3, steps=2)
    parts = [split[f"{name}_s"] for name in ("physics", "control", "python", "rendering")]
    assert sum(parts) == pytest.approx(split["step_s"])
    assert all(split[key] > 0 for key in ("physics_s", "step_without_pictures_s", "step_s"))  # no order: it is timing
    assert simulator.describe()["cameras"] == list(simulator._env.cameras)
    assert len(simulator._env.cameras) == 3


def test_a_worker_that_fails_says_why(tmp_path: Path) -> None:
    workers = module("workers")
    program = tmp_path / "program.py"
    program.write_text("import sys\nprint('no such device', file=sys.stderr)\nraise SystemExit(3)\n")
    with pytest.raises(workers.WorkerError, match=r"status 3: no such device"):
        workers.Worker("broken", Path(sys.executable), program)
    program.write_text(
        f"import sys\nsys.path.insert(0, {str(BENCHMARKS / 'peers')!r})\nimport sim_loop\n"
        "class Failing:\n    def make(self, cameras):\n"
        "        print('no answer')\n        raise ValueError('bad scene')\n"
        "sim_loop.serve(Failing())\n"
    )
    with (
        workers.Worker("failing", Path(sys.executable), program) as worker,
        pytest.raises(workers.WorkerError, match="bad scene"),
    ):
        worker.ask("make", cameras=False, seed=0)


def test_an_environment_that_cannot_be_made_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    venvs = module("venvs")
    (tmp_path / "requirements").mkdir()
    (tmp_path / "requirements" / "thing.lock").write_text("thing==1\n")
    monkeypatch.setattr(venvs, "BENCHMARKS", tmp_path)
    uv = tmp_path / "uv"
    uv.write_text("#!/bin/sh\necho 'no route to host' >&2\nexit 1\n")
    uv.chmod(0o755)
    monkeypatch.setattr(venvs, "_find_uv", lambda: str(uv))
    with pytest.raises(venvs.VenvError, match=r"no route to host[\s\S]*--without-peer"):
        venvs.prepare_venv("thing")
    # One that is there and of this lock is used as it is; one of another lock is made again.
    python = venvs.venv_folder("thing") / "bin" / "python"
    uv.write_text(f"#!/bin/sh\nmkdir -p {python.parent}\ntouch {python}\n")
    assert venvs.prepare_venv("thing") == python
    uv.write_text("#!/bin/sh\nexit 1\n")
    assert venvs.prepare_venv("thing") == python
    (tmp_path / "requirements" / "thing.lock").write_text("thing==2\n")
    with pytest.raises(venvs.VenvError):
        venvs.prepare_venv("thing")


def example_result() -> dict[str, Any]:
    """A result with made-up figures: ratios that meet what is wanted without cameras and miss it with them."""
    spread = module("common").spread
    report = module("sim_report")
    steps = {
        name: {key: spread([factor, 2 * factor, 4 * factor]) for key, *_ in report.CONFIGURATIONS}
        for name, factor in zip(SIMULATORS, (10.0, 75.0), strict=True)
    }
    env = {
        "startup_s": 1.0, "construct_s": 1.0, "first_reset_s": 1.0, "resident_mib": 200.0, "env": "e",
        "resident_after_import_mib": 100.0, "cameras": ["a", "b", "c"], "versions": {"mujoco": "3"},
        "model": dict.fromkeys(report.MODEL_WORDS, 7),
    }  # fmt: skip
    kinds = [f"{kind}_{cameras}" for kind in report.RESET_TARGETS_S for cameras in ("no_cameras", "three_cameras")]
    resets = {name: {kind: {**spread([0.01, 0.02]), "growth_mib": 0.0} for kind in kinds} for name in SIMULATORS}
    split = {"physics_s": 0.002, "control_s": 0.001, "python_s": 0.001, "rendering_s": 0.016}
    return {
        "mode": "quick", "machine": module("common").machine(), "versions": {"mujoco": "3", "commit": "unknown"},
        "ratios": report.ratios(steps), "steps_per_second": steps, "reset_seconds": resets,
        "split_of_our_step": {**split, "step_without_pictures_s": 0.004, "step_s": 0.02},
        "envs": {name: {"no_cameras": env, "three_cameras": env} for name in SIMULATORS},
        "others_share_of_cores": spread([0.0, 0.3]), "effort": {"repetitions": 3},
    }  # fmt: skip


def check_result(result: dict[str, Any]) -> None:
    assert result["benchmark"] == "sim_speed"
    assert re.match(r"20\d\d-\d\d-\d\dT", result["date"])
    assert {"cpu", "cores", "memory_gib", "python"} <= set(result["machine"])
    assert {"mujoco", "commit"} <= set(result["versions"])
    keys = {key for key, *_ in module("sim_report").CONFIGURATIONS}
    assert set(result["ratios"]) == keys
    for name in SIMULATORS:
        assert set(result["steps_per_second"][name]) == keys
        for figures in result["steps_per_second"][name].values():
            assert 0 < figures["min"] <= figures["median"] <= figures["max"]
        assert len(result["reset_seconds"][name]) == 4
    for key, ratio in result["ratios"].items():
        ours, peer = (result["steps_per_second"][name][key]["median"] for name in ("ours", "robosuite"))
        assert ratio == pytest.approx(ours / peer)
    assert module("sim_report").report(result).count("\n") > 20


def test_results_are_written_whole_and_reported(tmp_path: Path) -> None:
    path = tmp_path / "new" / "sim_speed.json"
    module("common").write_result(path, "sim_speed", example_result())
    assert [p.name for p in path.parent.iterdir()] == ["sim_speed.json"]
    check_result(json.loads(path.read_text()))
    text = module("sim_report").report(example_result())
    assert "7.5x" in text
    assert ">= 7x met" in text
    assert ">= 28x MISSED" in text
    assert "NOT QUIET" in text


@pytest.mark.skipif(not RESULT.exists(), reason="no measured result in this checkout")
def test_stored_result_is_complete() -> None:
    check_result(json.loads(RESULT.read_text(encoding="utf-8")))


def test_ours_alone_has_no_ratios() -> None:
    body = example_result()
    for part in ("steps_per_second", "envs", "reset_seconds"):
        del body[part]["robosuite"]
    body["ratios"] = module("sim_report").ratios(body["steps_per_second"])
    assert body["ratios"] == {}
    assert "robosuite" not in module("sim_report").report(body)


def test_machine_and_noise() -> None:
    common = module("common")
    assert common.machine()["cores"] >= 1
    share = common.busy_share(0.05)
    assert share is None or 0.0 <= share <= 1.0
    assert re.fullmatch(r"unknown|[0-9a-f]{12}(\+changes)?", common.versions("numpy")["commit"])
    assert common.spread([3.0, 1.0, 2.0]) == {"median": 2.0, "min": 1.0, "max": 3.0, "values": [3.0, 1.0, 2.0]}
    assert common.table(["a", "b"], [["long", "1"]]) == "a     b\n-------\nlong  1"
