"""A checkpoint in our trials: the same actions as LeRobot's own rollout, with fewer pictures rendered."""

from __future__ import annotations

import dataclasses
import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from evaluation_env import SlideEnv
from tiny_checkpoint import SIZE

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.actor import ChunkActor, ChunkRequest, chunk_seed
from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.evaluation.actors.chunk_policy import ChunkPolicy, LoadedCheckpoint
from robocasa_lerobot.evaluation.actors.policy_runner import StepPolicy, load_actor, pick_device
from robocasa_lerobot.evaluation.planning.trials import TrialSpec, make_plan
from robocasa_lerobot.evaluation.run.rollout import run_trial

HORIZON = 30


@pytest.fixture
def spec() -> TrialSpec:
    (only,) = make_plan(["pretrain-000000"], {"Slide": HORIZON}, trials=1, seed=3, videos=0)
    return only


class Recorder(SlideEnv):
    """Keeps the actions, and counts the steps whose pictures were rendered."""

    def __init__(self, *args: Any, always: bool = False, **kwargs: Any) -> None:
        super().__init__(*args, image_size=SIZE, horizon=HORIZON, **kwargs)
        self.actions: list[np.ndarray] = []
        self.rendered = 0
        self.always = always
        self._max_episode_steps = HORIZON

    def reset(self, **kwargs: Any) -> Any:
        self.actions, self.rendered = [], 0
        return super().reset(**kwargs)

    def step(self, action: Any) -> Any:
        self.actions.append(np.asarray(action).copy())
        # Never arrives, so that every episode has the same length.
        return super().step(np.zeros(contract.ACTION_SIZE, np.float32))

    def _observe(self) -> Any:
        self.render_observations = self.render_observations or self.always
        self.rendered += self.render_observations
        return super()._observe()


def make_actor(checkpoint: Path, executed_steps: int | None = None) -> ChunkActor:
    actor = load_actor(read_source(str(checkpoint)), "cpu", executed_steps)
    assert isinstance(actor, ChunkActor)
    return actor


@pytest.mark.parametrize("kind", ["chunk", "step"])
def test_actions_are_those_of_lerobots_own_rollout(checkpoint: Path, spec: TrialSpec, kind: str) -> None:
    import gymnasium
    import torch
    from lerobot.processor import PolicyProcessorPipeline
    from lerobot.scripts.lerobot_eval import rollout

    loaded = LoadedCheckpoint(read_source(str(checkpoint)), "cpu", None)
    policy = ChunkPolicy(loaded, width=1)
    chunked = ChunkActor("label", policy.shape, lambda request: policy.predict([request])[0])
    ours = Recorder("Slide")
    outcome = run_trial(ours, chunked if kind == "chunk" else StepPolicy(loaded), spec)
    assert outcome.steps == len(ours.actions) == HORIZON or outcome.success

    theirs = Recorder("Slide", always=True)
    nothing: Any = PolicyProcessorPipeline(steps=[])
    steps = itertools.count()
    select = loaded.policy.select_action

    def select_with_our_noise(batch: Any) -> Any:
        number = next(steps) // policy.shape.executed
        return select(batch, generator=torch.Generator().manual_seed(chunk_seed(spec.policy_seed, number)))

    torch.manual_seed(spec.policy_seed)  # what StepPolicy draws from
    if kind == "chunk":
        loaded.policy.select_action = select_with_our_noise
    vector = gymnasium.vector.SyncVectorEnv([lambda: theirs])
    rollout(vector, loaded.policy, nothing, nothing, loaded.pre, loaded.post, seeds=[spec.seed])
    np.testing.assert_array_equal(np.stack(ours.actions), np.stack(theirs.actions)[: outcome.steps])


def requests_of(checkpoint: Path, count: int, policy: ChunkPolicy) -> list[ChunkRequest]:
    rng = np.random.default_rng(0)
    out = []
    for number in range(count):
        observations = tuple(
            {
                "pixels": {c: rng.integers(0, 255, (SIZE, SIZE, 3), dtype=np.uint8) for c in contract.CAMERAS},
                "agent_pos": rng.normal(size=contract.STATE_SIZE),
            }
            for _ in range(policy.shape.history)
        )
        out.append(ChunkRequest("label", observations, f"slide block {number}", seed=number, number=number % 3))
    return out


def test_a_chunk_does_not_depend_on_who_is_asked_for_with_it(checkpoint: Path) -> None:
    policy = ChunkPolicy(LoadedCheckpoint(read_source(str(checkpoint)), "cpu", None), width=1)
    requests = requests_of(checkpoint, 7, policy)
    together = [reply.actions for reply in policy.predict(requests)]
    assert len({actions.tobytes() for actions in together}) == 7
    order = np.random.default_rng(1).permutation(7)
    shuffled = policy.predict([requests[i] for i in order])
    for index, actions in enumerate(together):
        np.testing.assert_array_equal(actions, policy.predict([requests[index]])[0].actions)
        np.testing.assert_array_equal(actions, shuffled[int(np.flatnonzero(order == index)[0])].actions)
    # Other noise for another trial, and for the next chunk of the same one.
    first = requests[0]
    for other in (dataclasses.replace(first, seed=9), dataclasses.replace(first, number=5)):
        assert not np.array_equal(policy.predict([other])[0].actions, together[0])


def test_onnx_runtime_computes_a_loaded_policy_unless_torch_is_asked_for(checkpoint: Path) -> None:
    source, chunks = read_source(str(checkpoint)), {}
    for runtime in ("onnx", "torch"):
        loaded = LoadedCheckpoint(source, "cpu", None, runtime)
        policy = ChunkPolicy(loaded, 1)
        chunks[runtime] = policy.predict(requests_of(checkpoint, 1, policy))[0].actions
        (ask,) = loaded.policy._decode._recorded.values()
        assert ("onnx" in getattr(ask, "__module__", "")) == (runtime == "onnx")
    assert chunks["onnx"].std() > 0
    np.testing.assert_allclose(chunks["onnx"], chunks["torch"], atol=1e-5)


@pytest.mark.parametrize("width", [2, 4])
@pytest.mark.parametrize("leak", [0.0, 1e-7])
def test_batches_are_full_and_a_leak_between_samples_is_found(
    checkpoint: Path, monkeypatch: pytest.MonkeyPatch, width: int, leak: float
) -> None:
    policy = ChunkPolicy(LoadedCheckpoint(read_source(str(checkpoint)), "cpu", None), width)
    sizes = []

    def compute(group: list[ChunkRequest]) -> np.ndarray:
        sizes.append(len(group))
        rows = [np.full((8, 12), request.seed, np.float64) + leak * place for place, request in enumerate(group)]
        return np.stack(rows).astype(np.float32)

    monkeypatch.setattr(policy, "_batch", compute)
    requests = requests_of(checkpoint, 7, policy)
    if leak:
        with pytest.raises(UserError, match=f"batch_width={width}: .* use --policy.batch_width=1"):
            policy.predict(requests)
        return
    assert [reply.actions[0, 0] for reply in policy.predict(requests)] == list(range(7))
    assert set(sizes) == {width}


def test_skipped_pictures_change_nothing_and_are_skipped(checkpoint: Path, spec: TrialSpec) -> None:
    runner = make_actor(checkpoint)
    lazy, eager = Recorder("Slide"), Recorder("Slide", always=True)
    assert run_trial(lazy, runner, spec) == run_trial(eager, runner, spec)
    np.testing.assert_array_equal(lazy.actions, eager.actions)
    assert eager.rendered == len(eager.actions) + 1
    # Chunks of 8 executed steps, each from 2 observations.
    assert lazy.rendered <= len(lazy.actions) / 4 + 2


def test_executed_steps_change_how_often_the_policy_looks(checkpoint: Path, spec: TrialSpec) -> None:
    runner = make_actor(checkpoint, 4)
    assert [runner.sees(step) for step in range(9)] == [True, False, False, True, True, False, False, True, True]
    with pytest.raises(UserError, match="executed_steps=10 does not fit: n_action_steps is 10, but horizon 10"):
        load_actor(read_source(str(checkpoint)), "cpu", 10)


def test_noise_is_fixed_by_the_trials_seed(checkpoint: Path, spec: TrialSpec) -> None:
    runner = make_actor(checkpoint)
    other = dataclasses.replace(spec, policy_seed=spec.policy_seed + 1)
    first, second, again = (run_trial(Recorder("Slide"), runner, s).trajectory for s in (spec, other, spec))
    assert first == again
    assert first != second


def test_an_unregistered_type_is_a_clear_error(checkpoint: Path, tmp_path: Path) -> None:
    folder = tmp_path / "pretrained_model"
    folder.mkdir()
    config = json.loads((checkpoint / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps({**config, "type": "nonsense"}))
    (folder / "model.safetensors").write_bytes(b"")
    with pytest.raises(UserError, match="policy type 'nonsense' is not registered"):
        load_actor(read_source(str(folder)), "cpu", None)


@pytest.mark.parametrize("device", ["gpu", "", "CPU", "cuda:977", "cuda:256", "cuda:-1", "meta", "xpu"])
def test_a_device_that_is_not_there_is_a_mistake(device: str) -> None:
    with pytest.raises(UserError, match=r"torch sees cpu.* or auto"):
        pick_device(device)
    assert pick_device("cpu") == "cpu"


def test_each_gpu_has_its_number(monkeypatch: pytest.MonkeyPatch) -> None:
    import torch

    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    assert [pick_device(device) for device in ("auto", "cuda", "cuda:1")] == ["cuda", "cuda", "cuda:1"]
    with pytest.raises(UserError, match="cpu, cuda, cuda:0, cuda:1"):
        pick_device("cuda:2")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(UserError, match="'cuda:1' is not there"):
        pick_device("cuda:1")
