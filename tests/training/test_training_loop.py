"""The loop's safeguards and extras: bad losses, pruning, signals, augmentation, trackers."""

from __future__ import annotations

import importlib.util
import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from accelerate import Accelerator, tracking
from accelerate.utils import LoggerType
from training_support import ROOT, experiment_file, losses, metrics, tiny

from robocasa_lerobot import contract
from robocasa_lerobot.cli import main
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.child_process import STOP_SIGNALS
from robocasa_lerobot.training import metrics as module
from robocasa_lerobot.training.augment import BLANK, augment
from robocasa_lerobot.training.config.experiment import TRACKERS
from robocasa_lerobot.training.config.phase import AugmentConfig
from robocasa_lerobot.training.interrupts import REQUEUE
from robocasa_lerobot.training.loading import InFile, load_batches
from robocasa_lerobot.training.loop import part_shares
from robocasa_lerobot.training.phases import run_experiment
from robocasa_lerobot.training.setup.build_phase import prepare_phase
from robocasa_lerobot.training.setup.builders import frame_size, policy_config
from robocasa_lerobot.training.shared_noise import SharedNoise
from robocasa_lerobot.training.weights.checkpoint import CHECKPOINTS, last_checkpoint, prune, tidy

CAMERA = contract.IMAGE_KEYS[0]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.set_num_threads(1)
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=4, length=12, image_size=32)


def test_batch_of_a_bad_loss_is_kept(tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The third step's loss is no number: weights stay those of the second, and the batch can be looked at."""
    from robocasa_lerobot.policies.diffusion_transformer.modeling_diffusion_transformer import (
        DiffusionTransformerPolicy,
    )

    whole, calls = DiffusionTransformerPolicy.forward, []

    def sick(self: Any, batch: dict[str, Any], *args: Any, **kwargs: Any) -> Any:
        calls.append(batch)
        loss, outputs = whole(self, batch, *args, **kwargs)
        return (loss * float("nan") if len(calls) == 3 else loss), outputs

    monkeypatch.setattr(DiffusionTransformerPolicy, "forward", sick)
    experiment = tiny(tmp_path, data)
    with pytest.raises(UserError, match=r"the loss is nan.* at step 3.*Its values are finite"):
        run_experiment(experiment)
    (saved,) = (tmp_path / "out/pretrain").glob("bad_batch_*.pt")
    content = torch.load(saved, weights_only=False)
    assert content["step"] == 2
    np.testing.assert_array_equal(content["parts"][0]["index"], calls[2]["index"])
    last = last_checkpoint(tmp_path / "out/pretrain")
    assert last is not None
    assert last.name == "000002"
    monkeypatch.undo()
    assert not run_experiment(experiment, stop_after=2)  # with the cause gone, it goes on from there
    assert [step for step, *_ in losses(tmp_path, "pretrain")] == [1, 2, 3, 4]


def checkpoint_names(phase: Path) -> list[str]:
    return sorted(path.name for path in (phase / CHECKPOINTS).iterdir() if path.name.isdigit())


def test_checkpoints_are_pruned_by_rule(tmp_path: Path) -> None:
    for step in range(0, 70, 10):
        (tmp_path / CHECKPOINTS / f"{step:06d}").mkdir(parents=True)
    prune(tmp_path, keep_last=0, keep_every=0)
    assert len(checkpoint_names(tmp_path)) == 7
    prune(tmp_path, keep_last=2, keep_every=20)
    assert checkpoint_names(tmp_path) == ["000000", "000020", "000040", "000050", "000060"]
    prune(tmp_path, keep_last=1, keep_every=0)
    assert checkpoint_names(tmp_path) == ["000000", "000060"]


def test_what_a_kill_left_is_put_in_order(tmp_path: Path) -> None:
    parent = tmp_path / CHECKPOINTS
    for name in ("000010", "000020", ".writing-000030", ".dropped-000005"):
        (parent / name).mkdir(parents=True)
    (parent / "last").symlink_to("000010")
    tidy(tmp_path)
    assert sorted(path.name for path in parent.iterdir()) == ["000010", "000020", "last"]
    assert (parent / "last").readlink() == Path("000020")


def test_training_prunes_as_it_goes(tmp_path: Path, data: Path) -> None:
    run_experiment(tiny(tmp_path, data, overrides=["--defaults.save_every=1", "--defaults.keep_last=2"]), stop_after=4)
    assert checkpoint_names(tmp_path / "out/pretrain") == ["000000", "000003", "000004"]


def test_signal_saves_and_asks_for_another_turn(tmp_path: Path, data: Path) -> None:
    path = experiment_file(tmp_path, data, defaults={"steps": 100000, "save_every": 2})
    done = threading.Event()

    def ask() -> None:
        while not (tmp_path / "out/pretrain/checkpoints/000002").is_dir() and not done.is_set():
            time.sleep(0.01)
        if not done.is_set():
            os.kill(os.getpid(), signal.SIGUSR1)

    asking = threading.Thread(target=ask)
    asking.start()
    try:
        assert main(["train", "--config_path", str(path)]) == REQUEUE
    finally:
        done.set()
        asking.join()
    last = last_checkpoint(tmp_path / "out/pretrain")
    assert last is not None
    assert int(last.name) == metrics(tmp_path, "pretrain")[-1]["step"] < 100000


@pytest.mark.costly
def test_loader_processes_outlive_what_asks_the_run_to_end(tmp_path: Path, data: Path) -> None:
    """From their first moment on; and one that hangs is ended all the same when nobody needs it any more."""
    experiment = tiny(tmp_path, data)
    run = prepare_phase(experiment, experiment.phases[0], "cpu", Accelerator(cpu=True))
    wanted = load_batches(run.batches, first=1, end=3, workers=0)
    found = load_batches(run.batches, first=1, end=3, workers=1)
    (process,) = active_children()
    for batch in wanted:
        for number in STOP_SIGNALS:
            os.kill(process.pid or 0, number)
        assert torch.equal(next(found)["index"], batch["index"])
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == set()
    os.kill(process.pid or 0, signal.SIGSTOP)
    del found
    process.join()
    assert process.exitcode == -signal.SIGKILL


def test_loader_processes_are_started_without_waiting_for_each_other(tmp_path: Path, data: Path) -> None:
    """What one is started with fits into a pipe: its parent would wait until it has imported everything."""
    experiment = tiny(tmp_path, data)
    run = prepare_phase(experiment, experiment.phases[0], "cpu", Accelerator(cpu=True))
    handed = InFile(run.batches)
    assert len(pickle.dumps(handed)) < 4096
    assert torch.equal(pickle.loads(pickle.dumps(handed))[1]["index"], run.batches[1]["index"])


@pytest.mark.slow
@pytest.mark.parametrize("number", STOP_SIGNALS)
def test_signal_to_all_processes_saves_and_asks_for_another_turn(
    tmp_path: Path, data: Path, number: signal.Signals
) -> None:
    """As `timeout 23h python train.py ...` sends it."""
    path = experiment_file(tmp_path, data, defaults={"steps": 100000, "save_every": 2}, loader={"workers": 2})
    command = [sys.executable, str(ROOT / "train.py"), "--config_path", str(path)]
    with subprocess.Popen(command, start_new_session=True) as process:
        try:
            while not (tmp_path / "out/pretrain/checkpoints/000002").is_dir():
                assert process.poll() is None
                time.sleep(0.05)
            os.killpg(process.pid, number)
            assert process.wait() == REQUEUE
        finally:
            process.kill()
    last = last_checkpoint(tmp_path / "out/pretrain")
    assert last is not None
    assert int(last.name) == metrics(tmp_path, "pretrain")[-1]["step"]


def pictures(count: int = 4) -> dict[str, torch.Tensor]:
    return {CAMERA: torch.rand(count, 2, 3, 16, 16, generator=torch.Generator().manual_seed(0))}


def changed(config: AugmentConfig, seed: int = 0, count: int = 4) -> torch.Tensor:
    return augment(pictures(count), [CAMERA], config, seed)[CAMERA]


def test_no_augmentation_changes_nothing() -> None:
    assert torch.equal(changed(AugmentConfig()), pictures()[CAMERA])


FULL = AugmentConfig(crop=0.9, rotate=5, brightness=0.3, contrast=0.4, saturation=0.5, hue=0.08, blank=0.3)


def test_augmentation_belongs_to_samples() -> None:
    """The same seed gives the same pictures, each sample its own change, and a sample's the same over time."""
    assert torch.equal(changed(FULL), changed(FULL))
    assert not torch.equal(changed(FULL), changed(FULL, seed=1))
    same = {CAMERA: pictures(1)[CAMERA][:, :1].expand(3, 2, 3, 16, 16).contiguous()}
    out = augment(same, [CAMERA], FULL, 0)[CAMERA]
    assert torch.allclose(out[:, 0], out[:, 1], atol=1e-6)
    assert not torch.allclose(out[0], out[1], atol=1e-3)
    assert 0 <= float(out.min()) <= float(out.max()) <= 1


def test_processes_augment_their_part_of_the_batch() -> None:
    batch = pictures(4)[CAMERA]
    whole = augment({CAMERA: batch}, [CAMERA], FULL, 0)[CAMERA]
    parts = [augment({CAMERA: batch[2 * r : 2 * r + 2]}, [CAMERA], FULL, 0, r, 2)[CAMERA] for r in range(2)]
    torch.testing.assert_close(torch.cat(parts), whole)


def test_each_augmentation_does_what_it_says() -> None:
    before = pictures()[CAMERA]
    grey = before.mean(dim=2, keepdim=True).expand_as(before).contiguous()
    for name in ("saturation", "hue"):  # grey has neither
        out = augment({CAMERA: grey}, [CAMERA], AugmentConfig(**{name: 0.5}), 0)[CAMERA]
        torch.testing.assert_close(out, grey, atol=2e-3, rtol=0)
        assert not torch.allclose(changed(AugmentConfig(**{name: 0.5})), before, atol=1e-2)
    dim = 0.5 * before  # far from where values are cut off
    brighter = augment({CAMERA: dim}, [CAMERA], AugmentConfig(brightness=0.3), 0)[CAMERA] / dim
    factors = brighter[:, 0, 0, 0, 0]
    torch.testing.assert_close(brighter, factors[:, None, None, None, None].expand_as(brighter))
    assert 0.7 <= float(factors.min()) < float(factors.max()) <= 1.3
    flat = torch.full((4, 1, 3, 16, 16), 0.25)
    torch.testing.assert_close(augment({CAMERA: flat}, [CAMERA], AugmentConfig(crop=0.5, rotate=30), 0)[CAMERA], flat)
    ramp = torch.linspace(0, 1, 16).expand(4, 1, 3, 16, 16).contiguous()
    steps = augment({CAMERA: ramp}, [CAMERA], AugmentConfig(crop=0.5), 0)[CAMERA].diff(dim=-1)
    torch.testing.assert_close(steps[..., 4:-4], torch.full_like(steps[..., 4:-4], 0.5 / 15))  # half as steep
    kept = augment({CAMERA: ramp}, [CAMERA], AugmentConfig(crop=0.5, crop_cameras=["*wrist*"]), 0)[CAMERA]
    assert torch.equal(kept, ramp)


def test_cameras_are_blanked_in_a_share_of_the_samples_each_on_its_own() -> None:
    cameras = ["observation.images.left", "observation.images.right", "observation.images.wrist"]
    batch = {key: torch.rand(2000, 1, 3, 2, 2) * 0.4 for key in cameras}
    out = augment(batch, cameras, AugmentConfig(blank=0.3, blank_cameras=["*left", "*right"]), 0)
    assert torch.equal(out[cameras[2]], batch[cameras[2]])
    blank = {key: (out[key] == BLANK).flatten(1).all(dim=1) for key in cameras[:2]}
    for key, which in blank.items():
        assert torch.equal(out[key][~which], batch[key][~which])
        assert 0.26 < float(which.float().mean()) < 0.34
    assert 0.06 < float((blank[cameras[0]] & blank[cameras[1]]).float().mean()) < 0.12
    with pytest.raises(UserError, match="blank is 1"):
        AugmentConfig(blank=1)


def test_training_with_everything_on(tmp_path: Path, data: Path) -> None:
    overrides = ["--defaults.augment={crop: 0.9, hue: 0.1}", "--defaults.gradient_accumulation=2"]
    assert not run_experiment(tiny(tmp_path / "a", data, overrides=overrides), stop_after=4)
    assert not run_experiment(tiny(tmp_path / "b", data, overrides=overrides), stop_after=2)
    assert not run_experiment(tiny(tmp_path / "b", data, overrides=overrides), stop_after=2)
    assert losses(tmp_path / "a", "pretrain") == losses(tmp_path / "b", "pretrain")
    line = metrics(tmp_path / "a", "pretrain")[-1]
    assert 0 <= line["data_share"] <= 1
    assert line["samples_per_second"] == pytest.approx(4 / line["seconds_per_step"])


def test_tracker_that_cannot_begin_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    accelerator = Accelerator(cpu=True)
    monkeypatch.setattr(accelerator, "log_with", ["wandb"])
    monkeypatch.setattr(accelerator, "init_trackers", lambda *_, **__: [][0])
    with pytest.raises(UserError, match=r"\(wandb\): list index.*`wandb login`.*leave `trackers` out"):
        module.start_trackers(accelerator, "name", {})


@pytest.mark.parametrize("tracker", TRACKERS)
def test_tracker_without_its_package_is_told(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch, tracker: str
) -> None:
    """Before anything is trained or written, with the command that installs it."""
    if importlib.util.find_spec(tracker) is not None:  # installed here
        monkeypatch.setattr(module, "get_available_trackers", lambda: [])
    remedy = f"-m pip install {tracker}`, or take it out"
    with pytest.raises(UserError, match=f"tracker {tracker!r}: its package is not installed") as raised:
        run_experiment(tiny(tmp_path, data, overrides=[f"--trackers=[{tracker}]"]))
    assert remedy in str(raised.value)
    assert not (tmp_path / "out").exists()


@pytest.mark.costly
@pytest.mark.parametrize("tracker", TRACKERS)
def test_trackers_get_the_metrics(tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch, tracker: str) -> None:
    """Accelerate hands them to a class of the tracker's name, which stands in for one that would send them."""
    got: list[tuple[str, Any]] = []
    known_as, real = tracker, tracking.LOGGER_TYPE_TO_CLASS[tracker]

    class Noting(tracking.GeneralTracker):
        name, requires_logging_directory = known_as, real.requires_logging_directory
        main_process_only = True

        def __init__(self, run_name: str, *folder: str) -> None:
            super().__init__()
            got.append(("run", run_name))

        @property
        def tracker(self) -> None:
            return None

        def store_init_configuration(self, values: dict[str, Any]) -> None:
            got.append(("settings", values))

        def log(self, values: dict[str, Any], step: int | None = None, **kwargs: Any) -> None:
            got.append(("line", {**values, "step": step}))

        def finish(self) -> None:
            got.append(("end", None))

    monkeypatch.setitem(tracking.LOGGER_TYPE_TO_CLASS, tracker, Noting)
    monkeypatch.setattr(tracking, "_available_trackers", [LoggerType(tracker)])
    run_experiment(tiny(tmp_path, data, overrides=[f"--trackers=[{tracker}]"]), stop_after=6)
    kinds = [kind for kind, _ in got]
    assert kinds == ["run", "settings", *["line"] * 6, "end"]
    assert got[0][1] == "test"
    settings = got[1][1]
    assert settings["seed"] == 0
    assert json.loads(settings["policy"])["type"] == "diffusion_transformer"
    sent = [value for kind, value in got if kind == "line"]
    # Steps that begin again would be dropped by wandb.
    assert [values["step"] for values in sent] == [1, 2, 3, 4, 5, 6]
    for phase, lines in (("pretrain", sent[:4]), ("finetune", sent[4:])):
        for values, line in zip(lines, metrics(tmp_path, phase), strict=True):
            numbers = {f"{phase}/{key}": value for key, value in line.items() if isinstance(value, int | float)}
            assert {name: value for name, value in values.items() if name != "step"} == numbers
            assert {f"{phase}/loss", f"{phase}/step", f"{phase}/grad_norm"} <= numbers.keys()


def test_shared_noise_is_that_of_one_process() -> None:
    def draws() -> list[torch.Tensor]:
        times = torch.distributions.Beta(torch.tensor(1.5), torch.tensor(1.0)).sample((draws.rows,))  # type: ignore[attr-defined]
        like = torch.zeros(draws.rows * 2, 5)  # type: ignore[attr-defined]
        steps = torch.randint(low=0, high=100, size=(draws.rows,))  # type: ignore[attr-defined]
        flow = torch.normal(mean=0.0, std=1.0, size=(draws.rows, 3), dtype=torch.float32)  # type: ignore[attr-defined]
        placed = torch.normal(0.0, 1.0, (draws.rows, 3))  # type: ignore[attr-defined]
        noise = [torch.randn(draws.rows, 3), torch.randn_like(like), flow, placed]  # type: ignore[attr-defined]
        return [*noise, steps, times, torch.rand(1)]

    draws.rows = 8  # type: ignore[attr-defined]
    torch.manual_seed(3)
    whole = draws()
    draws.rows = 4  # type: ignore[attr-defined]
    parts = []
    for rank in range(2):
        with SharedNoise(4, rank, 2, seed=3):
            parts.append(draws())
    for number in range(6):
        assert torch.equal(torch.cat([part[number] for part in parts]), whole[number])
    assert torch.equal(parts[0][6], parts[1][6])


@pytest.mark.parametrize(
    ("settings", "by_actions"),
    [
        ({"type": "act"}, True),
        ({"type": "smolvla"}, True),
        ({"type": "groot"}, True),
        ({"type": "diffusion"}, False),
        ({"type": "diffusion", "do_mask_loss_for_padding": True}, True),
        ({"type": "multi_task_dit"}, False),
        ({"type": "multi_task_dit", "do_mask_loss_for_padding": True}, True),
        ({"type": "diffusion_transformer"}, False),  # a mean over samples
        ({"type": "pi0"}, False),  # a mean over all actions
    ],
)
def test_parts_count_as_their_losses_are_means(settings: dict[str, Any], by_actions: bool) -> None:
    padded = [torch.tensor([[False, False, False, True]]), torch.tensor([[False, True, True, True]])]
    loaded = [{"action_is_pad": part} for part in padded]
    shares = part_shares(loaded, policy_config(settings, None, "cpu"), Accelerator(cpu=True))
    assert shares == ([0.75, 0.25] if by_actions else [0.5, 0.5])


def test_lines_of_metrics_are_json(tmp_path: Path, data: Path) -> None:
    run_experiment(tiny(tmp_path, data), stop_after=1)
    (line,) = (tmp_path / "out/pretrain/metrics.jsonl").read_text().splitlines()
    assert json.loads(line)["step"] == 1


@pytest.mark.parametrize(
    ("settings", "size"),
    [
        ({"type": "flow_vla", "image_size": [32, 48]}, (32, 48)),
        ({"type": "flow_vla"}, (128, 128)),
        ({"type": "flow_vla", "prefix": "pretrained"}, None),  # that of the model, known once it is loaded
        ({"type": "diffusion_transformer", "image_size": [32, 48]}, (32, 48)),
        ({"type": "diffusion_transformer"}, None),
        ({"type": "diffusion", "resize_shape": [32, 48]}, (32, 48)),
        ({"type": "act"}, None),
    ],
)
def test_frames_are_cached_at_the_size_that_the_policy_brings_them_to(
    settings: dict[str, Any], size: tuple[int, int] | None
) -> None:
    assert frame_size(policy_config(settings, None, "cpu")) == size
