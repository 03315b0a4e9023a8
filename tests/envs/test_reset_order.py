"""A scene is the same whatever the process has made before it, models and pictures to the bit."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys

import numpy as np
import pytest

from robocasa_lerobot.envs.kitchen_env import KitchenEnv

SCENES = [
    ("PickPlaceCounterToSink", "target", 11),
    ("TurnOnStove", "pretrain", 5),
    ("PickPlaceCounterToSink", "target", 12),
    ("OpenFridge", "pretrain", 6),
    ("BuildAppetizerPlate", "target", 7),
]


def digests(order: list[int]) -> dict[int, str]:
    """Of scenes by their number, each with all arrays of its model, its MJCF, first state and first pictures."""
    found = {}
    for number in order:
        task, split, seed = SCENES[number]
        env = KitchenEnv(task, split=split, image_size=96)
        observation, _ = env.reset(seed=seed)
        digest = hashlib.sha256(env.scene.spec.to_xml().encode())
        for name in sorted(dir(env.model)):
            value = getattr(env.model, name)
            if isinstance(value, np.ndarray):
                digest.update(name.encode() + value.tobytes())
        digest.update(env.get_state().physics.tobytes())
        for picture in observation["pixels"].values():
            digest.update(picture.tobytes())
        found[number] = digest.hexdigest()
        env.close()
    return found


@pytest.mark.costly
@pytest.mark.render
def test_a_scene_does_not_hang_on_those_before_it() -> None:
    forwards = digests([0, 1, 2, 3, 4])
    assert len(set(forwards.values())) == len(SCENES)
    for _ in range(2):  # a kitchen is kept when it comes again, and then copied
        assert digests([2, 0, 1]) == {number: forwards[number] for number in (2, 0, 1)}, "kept, but not the same"
    fresh = subprocess.run([sys.executable, __file__], capture_output=True, text=True, check=True)
    backwards = {int(number): digest for number, digest in json.loads(fresh.stdout.splitlines()[-1]).items()}
    assert backwards == forwards


if __name__ == "__main__":
    print(json.dumps(digests([4, 3, 2, 1, 0])))
