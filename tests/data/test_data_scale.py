"""A mixture of 550 datasets with 550,000 episodes: what it takes to start with it (`pytest -s -m slow` shows it)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from robocasa_lerobot import contract
from robocasa_lerobot.data.fake import write_fake_dataset

DATASETS, EPISODES, LENGTH = 550, 1000, 31  # 31: together more frames than 2^24
OPEN = 32
MAX_BYTES = 6e9

# In a process of its own, so that its memory is that of the mixture.
START = """
import json, resource, sys, time
from pathlib import Path
began = time.perf_counter()
from robocasa_lerobot.data.mixture_config import LoaderConfig, MemberConfig, MixtureConfig
from robocasa_lerobot.data.mixture import MixtureDataset, StepBatches
folder, open_files, keys = json.loads(sys.argv[1])
marks = {}
def mark(name):
    global began
    marks[name] = round(time.perf_counter() - began, 2)
    began = time.perf_counter()
mark("import")
members = [MemberConfig(str(root)) for root in sorted((Path(folder) / "datasets").iterdir())]
loader = LoaderConfig(cache_open_files=open_files, cache_dir=folder + "/cache")
dataset = MixtureDataset(MixtureConfig(members), loader=loader)
dataset.set_windows({key: [-0.05, 0.0] for key in keys} | {"action": [i / 20 for i in range(10)]})
mark("open")
batches = StepBatches(dataset, dataset.sampler(seed=0), 64)
mark("sampler")
fingerprint = dataset.fingerprint
mark("fingerprint")
first = batches[0]
mark("first batch")
for step in range(1, 10):
    batch = batches[step]
mark("nine more batches")
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
stats = dataset.statistics()
mark("statistics")
for step in range(10, 20):
    batch = batches[step]
mark("ten batches, columns mapped")
entries = [str(path.resolve()) for path in Path("/proc/self/fd").iterdir() if path.exists()]
print(json.dumps({
    "seconds": marks,
    "peak_bytes": peak,
    "peak_bytes_with_statistics": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
    "open": len({entry for entry in entries if entry.startswith(folder)}),
    "mapped": dataset._mapped,
    "episodes": dataset.meta.total_episodes,
    "frames": dataset.meta.total_frames,
    "tasks": len(dataset.meta.tasks),
    "count": int(stats["action"]["count"][0]),
    "median": stats["action"]["q50"].tolist(),
    "shape": list(first[keys[0]].shape),
}))
"""


def write_datasets(folder: Path) -> np.ndarray:
    """Metadata of its own for each dataset; the frames and the videos are the same files. Returns the actions."""
    template = write_fake_dataset(folder / "template", episodes=1, length=LENGTH, image_size=32)
    info = json.loads((template / "meta/info.json").read_text())
    info |= {"total_episodes": EPISODES, "total_frames": EPISODES * LENGTH}
    generator = np.random.default_rng(0)
    frames = np.arange(EPISODES * LENGTH)
    actions = generator.normal(0, 1, (len(frames), contract.ACTION_SIZE))
    states = generator.normal(0, 1, (len(frames), contract.STATE_SIZE))
    columns = {
        contract.STATE_KEY: pa.FixedSizeListArray.from_arrays(states.ravel(), contract.STATE_SIZE),
        contract.ACTION_KEY: pa.FixedSizeListArray.from_arrays(actions.ravel(), contract.ACTION_SIZE),
        "timestamp": (frames % LENGTH / info["fps"]).astype(np.float32),
        "frame_index": frames % LENGTH,
        "episode_index": frames // LENGTH,
        "index": frames,
        "task_index": frames // LENGTH % 20,
    }
    pq.write_table(pa.table(columns), folder / "data.parquet")
    starts = np.arange(EPISODES) * LENGTH
    zeros = np.zeros(EPISODES, np.int64)
    episodes = {"episode_index": np.arange(EPISODES), "dataset_from_index": starts, "dataset_to_index": starts + LENGTH}
    for key in contract.IMAGE_KEYS:
        episodes |= {f"videos/{key}/chunk_index": zeros, f"videos/{key}/file_index": zeros}
        episodes |= {f"videos/{key}/from_timestamp": zeros.astype(float)}
    for number in range(DATASETS):
        root = folder / "datasets" / f"dataset{number:03d}"
        (root / "meta/episodes/chunk-000").mkdir(parents=True)
        (root / "meta/info.json").write_text(json.dumps(info))
        texts = [f"instruction {index} of dataset {number}" for index in range(20)]
        tasks = pa.table({"task_index": np.arange(20), "task": texts})
        pandas = tasks.to_pandas().set_index("task")
        pandas.to_parquet(root / "meta/tasks.parquet")
        statistics = {
            f"stats/{key}/{name}": _nested(generator.uniform(0.2, 0.8, (EPISODES, 3)))
            for key in contract.IMAGE_KEYS
            for name in ("min", "max", "mean", "std")
        }
        pq.write_table(pa.table(episodes | statistics), root / "meta/episodes/chunk-000/file-000.parquet")
        (root / "data/chunk-000").mkdir(parents=True)
        os.link(folder / "data.parquet", root / "data/chunk-000/file-000.parquet")
        for video in (template / "videos").rglob("*.mp4"):
            copy = root / video.relative_to(template)
            copy.parent.mkdir(parents=True)
            os.link(video, copy)
    return actions


def _nested(values: np.ndarray) -> pa.Array:
    """(n, 3) as LeRobot stores statistics of pictures: lists of the shape (3, 1, 1)."""
    inner = pa.FixedSizeListArray.from_arrays(values.ravel(), 1)
    return pa.FixedSizeListArray.from_arrays(pa.FixedSizeListArray.from_arrays(inner, 1), 3)


@pytest.mark.slow
def test_550_datasets_with_550_000_episodes_start_within_bounds(tmp_path: Path) -> None:
    actions = write_datasets(tmp_path)
    argument = json.dumps([str(tmp_path), OPEN, list(contract.IMAGE_KEYS)])
    done = subprocess.run([sys.executable, "-c", START, argument], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    report = json.loads(done.stdout.splitlines()[-1])
    print(json.dumps(report, indent=1))
    assert report["episodes"] == DATASETS * EPISODES == 550_000
    assert report["frames"] == report["count"] == DATASETS * EPISODES * LENGTH > 2**24
    assert report["tasks"] == 20 * DATASETS
    assert report["shape"] == [64, 2, 3, 32, 32]
    assert report["mapped"]
    assert report["open"] <= 2 * OPEN  # videos, and mapped columns
    assert report["peak_bytes_with_statistics"] < MAX_BYTES
    wanted = np.quantile(actions.astype(np.float32), 0.5, axis=0, method="inverted_cdf")
    assert report["median"] == wanted.tolist()
