"""What a training step takes on this GPU: by preset, batch, precision and compilation, alone and several at a time.

    python benchmarks/gpu_training.py                       # all, about ten minutes
    python benchmarks/gpu_training.py --presets demo --limit-minutes 4

Small policies keep a GPU waiting for Python, which launches hundreds of kernels a step; so the step of a small batch
is what the processor takes, and larger batches, compilation and several trainings on one card are what may help. Each
variant is a training by the package's own loop in a process of its own, on made-up demonstrations whose frames are
cached. No peer: the ratios are between our own variants. Losses of the precisions are compared after the same steps
from the same seed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import common
import training_data
import training_sides
import yaml
from training_report import CACHED

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.progress import Bar
from robocasa_lerobot.training.setup.builders import device_name

OUTPUT = common.RESULTS / "gpu_training.json"
PRESETS = ("demo", "compact")
SMALL, LARGE = 64, 512  # samples a step
EPISODES = 12
WINDOW, WINDOWS = 50, 3  # steps of a line of metrics, and lines that count; the one before them warms up
FLOAT32, BF16 = "no", "bf16"
LOADER_WORKERS = 2


@dataclass(frozen=True)
class Variant:
    """A way to train a preset.

    Attributes:
        preset: of `diffusion_transformer`.
        batch_size: samples a step.
        precision: `no` is float32.
        compiled: translated by `torch.compile`.
        together: trainings at the same time on the one device.
    """

    preset: str
    batch_size: int = SMALL
    precision: str = FLOAT32
    compiled: bool = False
    together: int = 1

    @property
    def name(self) -> str:
        """Its key in the result."""
        words = [self.preset, str(self.batch_size), "float32" if self.precision == FLOAT32 else self.precision]
        words += ["compiled"] * self.compiled
        words += [f"x{self.together}"] * (self.together > 1)
        return "_".join(words)


def variants(presets: Sequence[str]) -> list[Variant]:
    """All that are measured, those first without which the others say nothing."""
    found = [Variant(preset) for preset in presets]
    found += [Variant(preset, LARGE) for preset in presets]
    found += [Variant(preset, batch, BF16) for preset in presets for batch in (SMALL, LARGE)]
    found += [Variant(preset, together=count) for preset in presets for count in (2, 4)]
    return found + [Variant(preset, batch, BF16, compiled=True) for preset in presets for batch in (SMALL, LARGE)]


def experiment(variant: Variant, job: training_sides.Job, output: Path) -> dict[str, Any]:
    """The experiment of `training_speed.py` on cached frames, with the moving average that is the default."""
    settings = training_sides.our_settings(training_sides.Side(CACHED, LOADER_WORKERS), job, output)
    settings["mixed_precision"] = variant.precision
    (phase,) = settings["phases"]
    del phase["ema"]
    phase |= {"save_every": 0, "compile": variant.compiled}
    return settings


def measure(variant: Variant, work: Path, device: str, window: int) -> dict[str, Any]:
    """Seconds a step, samples a second of all trainings together, share of waiting for data, memory, and the loss.

    Raises:
        UserError: a training failed; the message ends with what it said last.
    """
    settings = training_sides.policy_settings(variant.preset)
    size, *_ = settings.get("image_size") or [contract.IMAGE_SIZE]
    dataset = training_data.fake(work, EPISODES, size)
    processes = []
    for number in range(variant.together):
        folder = work / f"{variant.name}-{number}"
        folder.mkdir()
        job = training_sides.Job(settings, dataset, device, variant.batch_size, window, WINDOWS, folder)
        file = folder / "experiment.yaml"
        file.write_text(yaml.safe_dump(experiment(variant, job, folder / "run")))
        command = [sys.executable, str(Path(__file__).with_name("training_ours.py")), str(file)]
        command += ["--memory", str(folder / "memory.json")]
        with (folder / "log.txt").open("w") as log:
            processes.append((folder, subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)))
    try:
        statuses = [process.wait() for _, process in processes]
    finally:
        for _, process in processes:
            process.kill()
    for (folder, _), status in zip(processes, statuses, strict=True):
        if status:
            raise UserError(f"{variant.name} ended with status {status}:\n{(folder / 'log.txt').read_text()[-1500:]}")
    found = [training_sides.read_metrics(folder / "run" / "train" / "metrics.jsonl") for folder, _ in processes]
    memory = [json.loads((folder / "memory.json").read_text())["peak_gib"] for folder, _ in processes]
    together = sum(one["samples_per_second"] for one in found)
    return {
        "seconds_per_step": variant.batch_size * variant.together / together,
        "samples_per_second": together,
        "data_share": max(one["data_share"] for one in found),
        "peak_gib": sum(memory),
        "loss": found[0]["loss"],
    }


def ratios(measured: dict[str, dict[str, Any]]) -> dict[str, float]:
    """Samples a second of each variant over those of its preset's plain one, and losses likewise."""
    found = {}
    for name, values in measured.items():
        preset, batch = name.split("_")[:2]
        plain = measured.get(f"{preset}_{SMALL}_float32")
        if plain is not None and values is not plain:
            found[f"samples_{name}"] = round(values["samples_per_second"] / plain["samples_per_second"], 3)
        exact = measured.get(f"{preset}_{batch}_float32")
        if exact is not None and BF16 in name:
            found[f"loss_{name}"] = round(values["loss"] / exact["loss"], 3)
    return found


def rows(measured: dict[str, dict[str, Any]]) -> Iterator[list[str]]:
    """Of the table that is printed."""
    for name, one in measured.items():
        milliseconds, share = f"{1e3 * one['seconds_per_step']:.1f}", f"{100 * one['data_share']:.1f} %"
        yield [
            name,
            milliseconds,
            f"{one['samples_per_second']:,.0f}",
            share,
            f"{one['peak_gib']:.2f}",
            f"{one['loss']:.4f}",
        ]


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--presets", default=",".join(PRESETS), help=f"of diffusion_transformer (default {PRESETS})")
    parser.add_argument("--device", default="cuda", choices=("cuda", "cpu"), help="cpu: to try it (default cuda)")
    parser.add_argument("--variants", metavar="NAME,...", help="only those, by their names in the result")
    parser.add_argument("--window", type=int, default=WINDOW, help=f"steps of each of {WINDOWS} windows ({WINDOW})")
    parser.add_argument("--limit-minutes", type=float, default=60.0, help="begin no further variant after so long")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="JSON file to write")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write; what is measured is written after each variant."""
    options = parse(arguments)
    began, measured, failed = time.monotonic(), {}, {}
    wanted = variants(options.presets.split(","))
    if options.variants:
        names = options.variants.split(",")
        unknown = sorted(set(names) - {variant.name for variant in wanted})
        if unknown:
            print(f"gpu_training: no variant {unknown}; there are: {[v.name for v in wanted]}", file=sys.stderr)
            return 2
        wanted = [variant for variant in wanted if variant.name in names]
    about = {
        "machine": common.machine(),
        "device": device_name(options.device),
        "versions": common.versions("robocasa-lerobot", "lerobot", "torch", "accelerate"),
        "effort": {"window": options.window, "windows": WINDOWS, "loader_workers": LOADER_WORKERS},
    }
    with tempfile.TemporaryDirectory(prefix="gpu_training_") as folder, Bar(total=len(wanted), unit="variant") as bar:
        for variant in wanted:
            if time.monotonic() - began > 60 * options.limit_minutes:
                failed[variant.name] = "not begun: the time was over"
            else:
                try:
                    measured[variant.name] = measure(variant, Path(folder), options.device, options.window)
                except UserError as error:  # a card may lack memory for one, and the others are worth having
                    failed[variant.name] = str(error)
            bar.update(1)
            body = {**about, "ratios": ratios(measured), "variants": measured, "failed": failed}
            common.write_result(options.output, "gpu_training", body)
    print(common.table(["variant", "ms a step", "samples/s", "waiting", "GiB", "loss"], rows(measured)))
    for name, reason in failed.items():
        print(f"{name}: {reason}", file=sys.stderr)
    return 0 if measured else 1


if __name__ == "__main__":
    os.environ.setdefault("HF_HUB_OFFLINE", "1")
    raise SystemExit(main())
