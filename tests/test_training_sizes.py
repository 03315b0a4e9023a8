"""`--plan` sizes every policy that our files name, from the architectures of what they load, without the network."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import pytest
import yaml
from training_support import experiment_file

from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.training.config import load_experiment
from robocasa_lerobot.training.plan import PhasePlan, plan_experiment
from robocasa_lerobot.training.plan_text import render_plan
from robocasa_lerobot.training.weightless import architecture

POLICIES = Path(__file__).parents[1] / "configs/policies"
# Millions of parameters, all and trained: as published for CLIP with LeRobot's own head (277.5), SmolVLA (450),
# X-VLA (0.88 B) and GR00T (3 B); ours and pi0 as their parts add up.
SIZES: dict[str, tuple[float, float]] = {
    "diffusion_transformer_benchmark": (106.0, 106.0),
    "multi_task_dit": (277.5, 214.4),
    "smolvla": (450.0, 99.9),
    "xvla": (879.9, 879.9),
    "groot": (3144.0, 1620.5),
    "pi0": (4028.0, 4028.0),
    "flow_vla_smolvlm": (393.2, 99.5),
    "flow_vla_paligemma": (3144.3, 3129.1),
}
STARTS = {"pi0": "hub:lerobot/pi0_base", "smolvla": "hub:lerobot/smolvla_base", "xvla": "hub:lerobot/xvla-base"}


@pytest.fixture(autouse=True)
def _no_network(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refuse(*_: Any) -> None:
        raise AssertionError("the plan asked the network")

    monkeypatch.setattr(socket.socket, "connect", refuse)
    monkeypatch.setattr("huggingface_hub.constants.HF_HUB_CACHE", str(tmp_path / "empty"))


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=2, length=10, image_size=32)


def planned(folder: Path, data: Path, policy: dict[str, Any], **phase: Any) -> tuple[PhasePlan, str]:
    folder.mkdir(exist_ok=True)
    one = {"name": "train", "mixture": {"members": [{"root": str(data)}]}, "steps": 4, "statistics": "replace", **phase}
    content = {"name": "sizes", "output_dir": str(folder / "out"), "policy": policy, "device": "cpu", "phases": [one]}
    path = folder / "experiment.yaml"
    path.write_text(yaml.safe_dump(content))
    experiment = load_experiment(path)
    (plan,) = plan_experiment(experiment, measured_steps=0)
    return plan, render_plan(experiment, [plan], "cpu")


@pytest.mark.parametrize("name", sorted(SIZES))
def test_policies_are_sized_without_their_weights(name: str, tmp_path: Path, data: Path) -> None:
    start = {"init": STARTS[name]} if name in STARTS else {}
    plan, text = planned(tmp_path, data, {"file": str(POLICIES / f"{name}.yaml")}, **start)
    assert plan.parameters is not None, plan.notes
    assert tuple(round(count / 1e6, 1) for count in plan.parameters) == SIZES[name]
    assert f"parameters: {SIZES[name][0]:,.1f} M" in text
    assert "memory: " in text
    assert not (tmp_path / "out").exists()


def test_memory_and_disk_of_half_precision(tmp_path: Path, data: Path) -> None:
    """pi0 in bfloat16 takes no less than in float32, because the optimiser and averages need float32 beside it."""
    found = {}
    for dtype in ("bfloat16", "float32"):
        policy = {"file": str(POLICIES / "pi0.yaml"), "dtype": dtype}
        found[dtype], _ = planned(tmp_path / dtype, data, policy, init=STARTS["pi0"])
    whole = found["float32"].parameters
    assert whole is not None
    assert found["float32"].memory_bytes == 20 * whole[0]  # weights, gradients, two of Adam, average: 4 each
    assert found["bfloat16"].memory_bytes == 20 * whole[0]  # 2 + 2 + 4 (master weights) + 8 + 4
    assert found["bfloat16"].checkpoint_bytes > 16 * whole[0]


def test_a_folder_says_what_it_holds(tmp_path: Path, data: Path) -> None:
    from transformers import CLIPTextConfig, CLIPTextModelWithProjection

    sizes = {"vocab_size": 64, "hidden_size": 16, "intermediate_size": 32, "num_attention_heads": 2}
    tiny = CLIPTextModelWithProjection(CLIPTextConfig(num_hidden_layers=1, projection_dim=48, **sizes))
    tiny.save_pretrained(tmp_path / "clip")
    (tmp_path / "clip/model.safetensors").unlink()
    path = experiment_file(tmp_path, data, policy={"text_encoder": "clip", "clip_path": str(tmp_path / "clip")})
    plans = plan_experiment(load_experiment(path), measured_steps=0)
    assert all(plan.parameters is not None for plan in plans), plans[0].notes
    with pytest.raises(UserError, match=r"hf download somebody/model config\.json"):
        architecture("somebody/model")
