"""A tiny made-up LeRobotDataset v3.0 with the contract's features, for tests and `configs/debug.yaml`.

It can be learnt: the first end-effector action follows the brightness of the pictures, the gripper follows the
instruction, and the rest follows the state.
"""

from __future__ import annotations

import json
import logging
import re
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from lerobot.configs import RGBEncoderConfig
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robocasa_lerobot import contract
from robocasa_lerobot.data.reading.source import EPISODE_TABLE
from robocasa_lerobot.quiet import quiet_libraries

INSTRUCTIONS = {
    "OpenDrawer": "open the left drawer",
    "CloseDrawer": "close the left drawer",
    "PickPlaceCounterToSink": "pick the apple from the counter and place it in the sink",
}
KITCHENS = ((11, 34), (15, 14))  # layout and style, taking turns from one round of the tasks to the next


def write_fake_dataset(
    root: Path,
    episodes: int = 4,
    length: int = 16,
    image_size: int = 32,
    seed: int = 0,
    tasks: Sequence[str] = ("OpenDrawer", "CloseDrawer"),
    decisions: bool = False,
) -> Path:
    """Write the dataset at `root`, which must not exist, complete or not at all; episode i has task i % len(tasks).

    Pictures are image_size x image_size pixels; every episode has `length` frames. With `decisions` it says who decided
    them: a person the second half of each episode.
    """
    quiet_libraries()
    root.parent.mkdir(parents=True, exist_ok=True)
    aside = Path(tempfile.mkdtemp(prefix=f".{root.name}.", dir=root.parent))
    try:
        _write(aside / root.name, episodes, length, image_size, np.random.default_rng(seed), tasks, decisions)
        (aside / root.name).rename(root)
    finally:
        shutil.rmtree(aside)
    return root


def _write(
    folder: Path,
    episodes: int,
    length: int,
    image_size: int,
    generator: np.random.Generator,
    tasks: Sequence[str],
    decisions: bool,
) -> None:
    person = contract.decision_key("intervention")
    more = {person: {"dtype": "float64", "shape": (1,), "names": None}} if decisions else {}
    dataset = LeRobotDataset.create(
        repo_id=folder.name,
        fps=contract.VIDEO_FPS,
        features=contract.dataset_features((image_size, image_size)) | more,
        root=folder,
        robot_type=contract.ROBOT_TYPE,
        video_backend="pyav",
        streaming_encoding=True,
        encoder_queue_maxsize=0,  # 0 is unbounded: a full queue silently drops frames
        encoder_threads=1,
        rgb_encoder=RGBEncoderConfig(vcodec="h264", preset="ultrafast", crf=18),
    )
    rows = []
    try:
        for episode in range(episodes):
            task = tasks[episode % len(tasks)]
            for number, frame in enumerate(_frames(task, length, image_size, generator)):
                dataset.add_frame(frame | {key: np.array([float(number >= length // 2)]) for key in more})
            dataset.save_episode()
            kitchen = KITCHENS[episode // len(tasks) % len(KITCHENS)]
            rows.append(
                {
                    "episode_index": episode,
                    "task_name": task,
                    "instruction": _instruction(task),
                    "length": length,
                    "layout_id": kitchen[0],
                    "style_id": kitchen[1],
                }
            )
    finally:
        dataset.finalize()
    table = folder / EPISODE_TABLE
    table.parent.mkdir(parents=True, exist_ok=True)
    table.write_text("".join(json.dumps(row) + "\n" for row in rows))
    logging.getLogger(__name__).info("wrote a fake dataset of %d episodes", episodes)


def _frames(task: str, length: int, image_size: int, generator: np.random.Generator) -> list[dict[str, object]]:
    phase = generator.uniform(0, 2 * np.pi)
    ramp = np.linspace(0, 1, image_size, dtype=np.float64)
    out: list[dict[str, object]] = []
    for t in range(length):
        swing = np.sin(phase + 2 * np.pi * t / length)
        state = generator.normal(0, 0.1, contract.STATE_SIZE)
        state[contract.STATE_SLICES["base_rotation"]] = (0, 0, 0, 1)
        action = np.zeros(contract.ACTION_SIZE)
        action[contract.ACTION_SLICES["end_effector_position"]] = (swing, state[7], state[8])
        action[contract.ACTION_SLICES["control_mode"]] = -1
        action[contract.ACTION_SLICES["gripper_close"]] = 1 if task == "OpenDrawer" else -1
        shade = np.clip(127 + 100 * swing + 20 * ramp, 0, 255).astype(np.uint8)
        picture = np.broadcast_to(shade[None, :, None], (image_size, image_size, 3)).copy()
        frame: dict[str, object] = dict.fromkeys(contract.IMAGE_KEYS, picture)
        out.append(frame | {contract.STATE_KEY: state, contract.ACTION_KEY: action, "task": _instruction(task)})
    return out


def _instruction(task: str) -> str:
    """The task's instruction; of a task that has none here, the words of its name."""
    return INSTRUCTIONS.get(task) or " ".join(re.findall(r"[A-Z]?[a-z0-9]+|[A-Z]+(?![a-z])", task)).lower()
