"""Real peers ask our servers: openpi's own client, GR00T's published protocol, vla-eval's own runner.

Each runs in an environment of its own, without this package (vla-eval: beside it), that the benchmarks' lock files
make; where their packages cannot be installed, the tests are skipped with the reason.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from peer_environments import SUPPORT, peer, prepared
from serving_support import SIZE, observation, openpi_names, panda_omron_names, serving

from robocasa_lerobot import contract
from robocasa_lerobot.evaluation.actors.actor import ActingTime, ChunkActor, ChunkRequest, Observation
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource, read_source
from robocasa_lerobot.evaluation.actors.chunk_policy import ChunkPolicy
from robocasa_lerobot.evaluation.actors.reference_policies import DemonstratorPolicy
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.records.results import TrialRecord
from robocasa_lerobot.evaluation.run import engine
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.kitchens import Kitchens
from robocasa_lerobot.serving.policy import Answer, Served, ServedPolicy, Work, load_served

pytestmark = pytest.mark.slow

REPOSITORY = Path(__file__).parents[2]
INSTRUCTION = "open the left drawer"
SEEDS = [5, 6, 2**40]
SEED = 100_321  # of evaluations


def run_peer(python: Path, program: str, *arguments: str, folder: Path) -> None:
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    command = [str(python), str(SUPPORT / program), *arguments]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr


def expected(policy: ChunkPolicy, steps: list[Observation], number: int) -> np.ndarray:
    return policy.predict([ChunkRequest("x", tuple(steps), INSTRUCTION, SEEDS[number], number)])[0].actions


STEPS = [observation(1), observation(2)]


def test_openpis_own_client_gets_the_policys_actions(checkpoint: Path, in_process: ChunkPolicy, tmp_path: Path) -> None:
    asked = openpi_names(STEPS, INSTRUCTION)
    asked.pop("prompt")
    np.savez(tmp_path / "observations.npz", instruction=INSTRUCTION, seeds=np.array(SEEDS), **asked)
    with serving(Host(load_served(read_source(str(checkpoint)), "cpu")), "openpi") as port:
        run_peer(prepared("policy_clients"), "openpi_asks.py", str(port), folder=tmp_path)
    answers = np.load(tmp_path / "answers.npz")
    assert len(answers.files) == len(SEEDS)
    for number in range(len(SEEDS)):
        found = contract.hdf5_to_stored(answers[str(number)])
        np.testing.assert_allclose(found, expected(in_process, STEPS, number), rtol=0, atol=1e-6)


@pytest.mark.parametrize("version", ["1.5", "1.6"])
def test_gr00ts_protocol_gets_the_policys_actions(
    checkpoint: Path, in_process: ChunkPolicy, tmp_path: Path, version: str
) -> None:
    asked = panda_omron_names(STEPS, INSTRUCTION)
    asked.pop("annotation.human.task_description")
    np.savez(tmp_path / "observations.npz", instruction=INSTRUCTION, seeds=np.array(SEEDS), **asked)
    with serving(Host(load_served(read_source(str(checkpoint)), "cpu")), "gr00t", groot_version=version) as port:
        run_peer(prepared("policy_clients"), "gr00t_client.py", str(port), version, folder=tmp_path)
    answers = np.load(tmp_path / "answers.npz")
    for number in range(len(SEEDS)):
        found = contract.join_action({p.name: answers[f"{number}/action.{p.name}"] for p in contract.ACTION_PARTS})
        np.testing.assert_allclose(found, expected(in_process, STEPS, number), rtol=0, atol=1e-6)


class RecordedPolicy(ServedPolicy):
    """Keeps every request and its answer."""

    def __init__(self, policy: ServedPolicy) -> None:
        super().__init__(policy.served, policy._chunks, policy._make_actor)
        self.answered: dict[tuple[int, int], np.ndarray] = {}

    def answer(self, works: Sequence[Work]) -> list[Answer]:
        answers = super().answer(works)
        for work, one in zip(works, answers, strict=True):
            assert not isinstance(one, Exception), one
            self.answered[work.request.seed, work.request.number] = one
        return answers


class WrittenActor:
    """Actions that were written down beforehand, by the trial's seed; zeros after them."""

    def __init__(self, written: dict[int, list[np.ndarray]]) -> None:
        self.time, self._written = ActingTime(), written

    def reset(self, seed: int, env: Any) -> None:
        self._left = iter(self._written[seed])

    def act(self, observation: Observation, instruction: str) -> np.ndarray:
        return next(self._left, np.zeros(contract.ACTION_SIZE, dtype=np.float32))

    def sees(self, step: int) -> bool:
        return False


def run_vla_eval(
    python: Path, port: int, out: Path, trials: int, **params: Any
) -> dict[tuple[str, int], dict[str, Any]]:
    """What vla-eval's own runner says of each task's trials."""
    out.mkdir()
    benchmark = {
        "benchmark": "robocasa_lerobot.serving.vla_eval_benchmark:KitchenBenchmark",
        "episodes_per_task": trials,
        "params": {"seed": SEED, **params},
    }
    config = {
        "server": {"url": f"ws://127.0.0.1:{port}", "timeout": 120},
        "output_dir": str(out),
        "benchmarks": [benchmark],
    }
    (out / "run.yaml").write_text(yaml.safe_dump(config))
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "OMP_NUM_THREADS": "1"}
    command = [str(python.with_name("vla-eval")), "run", "--no-docker", "-c", str(out / "run.yaml")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    (aggregate,) = out.glob("*_aggregate.json")
    tasks = json.loads(aggregate.read_text())["tasks"]
    return {(task["task"], int(one["episode_id"])): one for task in tasks for one in task["episodes"]}


def evaluate(out: Path, policy: str, tasks: list[str], horizon: int, trials: int) -> list[TrialRecord]:
    arguments = [f"--policy.path={policy}", f"--env.tasks={','.join(tasks)}", f"--trials={trials}", f"--seed={SEED}"]
    arguments += [f"--env.horizon={horizon}", f"--env.image_size={SIZE}", "--workers=1", "--videos=0", f"--out={out}"]
    arguments += ["--policy.device=cpu", "--policy.label=x"]
    return engine.evaluate(engine.prepare(load_config(EvaluationConfig, arguments)))


@pytest.mark.render
@pytest.mark.timeout(1200)
def test_vla_evals_runner_in_our_kitchens_with_our_policy_behind_our_server(
    checkpoint: Path, in_process: ChunkPolicy, tmp_path: Path
) -> None:
    python, task, horizon, trials = prepared("vla_eval", on_ours=True), "OpenDrawer", 20, 2
    policy = RecordedPolicy(load_served(read_source(str(checkpoint)), "cpu"))
    with serving(Host(policy), "vla_eval") as port:
        found = run_vla_eval(python, port, tmp_path / "vla", trials, tasks=[task], max_steps=horizon)
    records = evaluate(tmp_path / "ours", str(checkpoint), [task], horizon, trials)
    assert [record.error for record in records] == [None] * trials
    kitchens = Kitchens([task], camera_size=SIZE, max_steps=horizon, seed=SEED)
    compared = 0
    for record in records:
        one = found[task, record.trial]
        assert (one["metrics"]["success"], one["steps"]) == (record.success, record.steps)
        # The same chunks as in process, in the same trial.
        seeds = kitchens.seeds(task, record.trial)
        assert seeds["seed"] == record.seed
        chunks: dict[int, np.ndarray] = {}

        def predict(request: ChunkRequest, chunks: dict[int, np.ndarray] = chunks) -> Any:
            (reply,) = in_process.predict([request])
            chunks[request.number] = reply.actions
            return reply

        actor = ChunkActor("x", in_process.shape, predict)
        actor.reset(seeds["policy_seed"], None)
        kitchens.reset(task, record.trial)
        env: Any = kitchens._env
        seen = env._observe()
        for _ in range(record.steps):
            seen, *_ = env.step(actor.act(seen, env.task_description))
        for number, chunk in chunks.items():
            answered = policy.answered[seeds["policy_seed"], number]
            np.testing.assert_allclose(answered, chunk, rtol=0, atol=1e-6)
            compared += 1
    kitchens.close()
    assert compared == len(policy.answered) == trials * 3


@pytest.mark.render
@pytest.mark.timeout(1200)
def test_vla_evals_runner_counts_the_same_successes_on_the_same_trials(tmp_path: Path) -> None:
    """Demonstrations written down in process are asked for over the socket; some do not end within the horizon."""
    python, tasks, horizon, trials = prepared("vla_eval", on_ours=True), ["CloseDrawer", "OpenDrawer"], 110, 2
    records = evaluate(tmp_path / "ours", "demonstrator", tasks, horizon, trials)
    kitchens = Kitchens(tasks, camera_size=SIZE, max_steps=horizon, seed=SEED)
    written: dict[int, list[np.ndarray]] = {}
    for record in records:
        kitchens.reset(record.task, record.trial)
        env: Any = kitchens._env
        env.render_observations = False
        actor = DemonstratorPolicy()
        actor.reset(0, env)
        actions = written.setdefault(kitchens.seeds(record.task, record.trial)["policy_seed"], [])
        for _ in range(record.steps):
            actions.append(actor.act({}, ""))
            env.step(actions[-1])
    kitchens.close()
    served = Served(PolicySource("written", "written", "written", "none"), (), 1, (0,), 1)
    host = Host(ServedPolicy(served, None, lambda: WrittenActor(written)))
    with serving(host, "vla_eval") as port:
        found = run_vla_eval(python, port, tmp_path / "vla", trials, tasks=tasks, max_steps=horizon, camera_size=SIZE)
    outcomes = {(record.task, record.trial): (record.success, record.steps) for record in records}
    assert {key: (one["metrics"]["success"], one["steps"]) for key, one in found.items()} == outcomes
    assert {success for success, _ in outcomes.values()} == {True, False}, outcomes


@pytest.mark.render
@pytest.mark.timeout(1200)
def test_vla_evals_runner_with_its_own_model_server_in_our_kitchens(tmp_path: Path) -> None:
    """Another project's policy, runner and server; only the kitchens are ours."""
    python, task, horizon, trials = prepared("vla_eval", on_ours=True), "OpenDrawer", 12, 2
    with peer(python, "vla_eval") as port:
        found = run_vla_eval(python, port, tmp_path / "vla", trials, tasks=[task], max_steps=horizon, camera_size=SIZE)
    assert set(found) == {(task, trial) for trial in range(trials)}
    assert all(one["steps"] == horizon and one["metrics"]["success"] is False for one in found.values())
