"""Our training beside LeRobot's, in one run: samples per second, time spent waiting for data, and loaders alone.

The same policy on the same dataset by `lerobot-train` as it comes, by our loop on LeRobot's loader, and by our loop on
our loader, each in a process of its own and in turn, so that whatever else the machine does hits all of them.

    python benchmarks/training_speed.py --quick
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import common
import training_data
import training_report
import training_sides

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.progress import Bar
from robocasa_lerobot.training.setup.builders import device_name

OUTPUT = common.RESULTS / "training_speed.json"
WORK = common.REPOSITORY / "outputs" / "training_speed"
OBSERVATIONS, CHUNKS = (1, 2), (10, 50)


@dataclass(frozen=True)
class Effort:
    """How much is measured: runs of each training, windows of steps in each, and seconds of a loader alone.

    Attributes:
        policies: presets, in batches of `batch_size`: LeRobot's default of 8 on a CPU.
        larger: preset, batch size and window of what is measured in other batches as well.
    """

    policies: tuple[str, ...]
    repetitions: int
    batch_size: int
    window: int
    windows: int
    loader_seconds: float
    episodes: int
    larger: tuple[tuple[str, int, int], ...] = ()

    @property
    def trainings(self) -> dict[str, tuple[str, int, int]]:
        """Preset, batch size and window by name in the result."""
        found = {policy: (policy, self.batch_size, self.window) for policy in self.policies}
        return found | {f"{policy}_of_{batch}": (policy, batch, window) for policy, batch, window in self.larger}


DEMO = ("demo", 64, 5)  # as `configs/experiments/demo.yaml` trains it
FULL = Effort(("demo", "compact"), 5, 8, window=20, windows=3, loader_seconds=5.0, episodes=8, larger=(DEMO,))
QUICK = Effort(("demo",), 2, batch_size=8, window=15, windows=2, loader_seconds=2.0, episodes=4, larger=(DEMO,))
FULL_GPU = dataclasses.replace(FULL, policies=("compact", "benchmark"), repetitions=3, batch_size=64, larger=())
QUICK_GPU = dataclasses.replace(QUICK, policies=("compact",), batch_size=64, larger=())


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one policy, fewer and shorter runs: about 15 minutes")
    parser.add_argument("--device", choices=("cpu", "cuda"), help="default: cuda where there is one")
    parser.add_argument("--workers", type=int, nargs="+", help="loader processes to try; default: two sensible numbers")
    parser.add_argument("--dataset", type=Path, help="a LeRobotDataset v3.0 with the contract's features")
    parser.add_argument("--fake", action="store_true", help="made-up frames instead of recording demonstrations")
    parser.add_argument("--loaders-only", action="store_true", help="no training, and no file unless --output is given")
    parser.add_argument(
        "--output", type=Path, help=f"JSON file to write; default: {OUTPUT.relative_to(common.REPOSITORY)}"
    )
    return parser.parse_args(arguments)


def worker_counts(device: str, cores: int) -> tuple[int, ...]:
    """Numbers of loader processes that are tried on every side, and the best one counts.

    On a CPU the loaders share the cores with the training; LeRobot's own default is 4.
    """
    return tuple(dict.fromkeys((0, min(4, cores)) if device == "cpu" else (4, min(16, cores))))


def measure_training(
    effort: Effort, dataset: Path, device: str, counts: Sequence[int], bar: Bar, noise: list[float]
) -> dict[str, dict[str, Any]]:
    """Figures of every side, by training."""
    sides = training_sides.sides(counts, counts[:1] if device == "cpu" else counts)
    found: dict[str, dict[str, Any]] = {}
    for name, (policy, batch_size, window) in effort.trainings.items():
        settings = training_sides.policy_settings(policy)
        runs: dict[str, list[dict[str, float]]] = {side.key: [] for side in sides}
        with tempfile.TemporaryDirectory(dir=_made(WORK), prefix="runs-") as folder:
            job = training_sides.Job(
                settings, dataset, device, batch_size, window, effort.windows, Path(folder) / policy
            )
            for repetition in range(effort.repetitions):
                # Who goes first alternates: a slow drift of the machine favours nobody.
                for side in sides if repetition % 2 == 0 else reversed(sides):
                    bar.set_description(f"{name}, {side.key}")
                    note_noise(noise)
                    runs[side.key].append(training_sides.run(side, job))
                    bar.update()
        found[name] = {
            key: {figure: common.spread([run[figure] for run in of_side]) for figure in of_side[0]}
            for key, of_side in runs.items()
        }
    return found


def measure_loaders(effort: Effort, dataset: Path, bar: Bar, noise: list[float]) -> dict[str, dict[str, Any]]:
    """Samples per second of each loader in this process, by `<observations>x<actions>`."""
    import training_loaders as loaders

    cache = _made(WORK) / "frame_cache"
    rates: dict[str, dict[str, list[float]]] = {}
    for repetition in range(effort.repetitions):
        for observations in OBSERVATIONS:
            for chunk in CHUNKS:
                kinds = (loaders.LEROBOT, loaders.DECODING, loaders.CACHED)
                for kind in kinds if repetition % 2 == 0 else reversed(kinds):
                    bar.set_description(f"loader {kind}, {observations} x {chunk}")
                    note_noise(noise)
                    windows = loaders.windows_for(observations, chunk)
                    batches = loaders.open_loader(kind, dataset, windows, effort.batch_size, 0, cache)
                    rate = loaders.samples_per_second(batches, effort.batch_size, effort.loader_seconds)
                    rates.setdefault(f"{observations}x{chunk}", {}).setdefault(kind, []).append(rate)
                    bar.update()
    return {
        windows: {kind: common.spread(by_kind[kind]) for kind in ("lerobot", "decoding", "cached")}
        for windows, by_kind in rates.items()
    }


def note_noise(noise: list[float]) -> None:
    """Add the share of the cores that others take at this moment, while nothing of ours runs."""
    share = common.busy_share()
    if share is not None:
        noise.append(share)


def describe_dataset(root: Path, kind: str) -> dict[str, Any]:
    """What was trained on; no paths."""
    info = json.loads((root / "meta" / "info.json").read_text())
    cameras = {key: f["shape"] for key, f in info["features"].items() if f["dtype"] in ("video", "image")}
    return {"kind": kind, "episodes": info["total_episodes"], "frames": info["total_frames"], "cameras": cameras}


def prepare_dataset(options: argparse.Namespace, effort: Effort, cores: int) -> tuple[Path, str]:
    """The dataset and what it is, made if it is not there."""
    if options.dataset is not None:
        return training_data.check(options.dataset), "given"
    if options.fake:
        return training_data.fake(_made(WORK), effort.episodes), "made-up"
    return training_data.converted(_made(WORK), effort.episodes, cores), "converted"


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    options = parse(arguments)
    from lerobot.utils.import_utils import get_safe_default_video_backend

    device = options.device or _best_device()
    small, large = (QUICK, FULL) if device == "cpu" else (QUICK_GPU, FULL_GPU)
    effort = small if options.quick else large
    machine = common.machine()
    counts = tuple(options.workers or worker_counts(device, machine["cores"]))
    noise: list[float] = []
    parts = effort.repetitions * len(OBSERVATIONS) * len(CHUNKS) * 3
    if not options.loaders_only:
        sides = training_sides.sides(counts, counts[:1] if device == "cpu" else counts)
        parts += effort.repetitions * len(effort.trainings) * len(sides)
    try:
        dataset, kind = prepare_dataset(options, effort, machine["cores"])
        with Bar(total=parts, unit="part", smoothing=0) as bar:
            training: dict[str, Any] = {}
            if not options.loaders_only:
                training = measure_training(effort, dataset, device, counts, bar, noise)
            loaders = measure_loaders(effort, dataset, bar, noise)
    except UserError as error:
        print(f"training_speed: {error}", file=sys.stderr)
        return 2
    body = {
        "mode": "quick" if options.quick else "full",
        "machine": machine,
        "device": device_name(device),
        "versions": common.versions("robocasa-lerobot", "lerobot", "torch", "torchcodec", "av", "accelerate"),
        "lerobot_decodes_with": get_safe_default_video_backend(),
        "dataset": describe_dataset(dataset, kind),
        "ratios": training_report.ratios(training, loaders),
        "training": training,
        "loaders": loaders,
        "others_share_of_cores": common.spread(noise) if noise else None,
        "effort": {**dataclasses.asdict(effort), "workers": list(counts)},
    }
    print(training_report.report(body))
    output = options.output or (None if options.loaders_only else OUTPUT)
    if output is not None:
        common.write_result(output, "training_speed", body)
        print(f"\nwritten: {output}")
    return 0


def _best_device() -> str:
    import torch

    return "cuda" if torch.cuda.is_available() else "cpu"


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder


if __name__ == "__main__":
    os.environ.setdefault("HF_HUB_OFFLINE", "1")
    raise SystemExit(main())
