"""Subtrees of bodies, beside walking from parent to parent."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.envs.scene.bodies import subtree


def hangs_on(model: mujoco.MjModel, body: int, root: int) -> bool:
    while body > root:  # a parent has a lower number than its child
        body = int(model.body_parentid[body])
    return body == root


@pytest.mark.parametrize("seed", range(5))
def test_it_is_what_walking_up_to_the_root_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    spec = mujoco.MjSpec()
    made = [spec.worldbody]
    for number in range(40):
        made.append(made[int(rng.integers(len(made)))].add_body(name=f"b{number}"))
    model = spec.compile()
    for root in range(model.nbody):
        expected = [hangs_on(model, body, root) for body in range(model.nbody)]
        assert subtree(model, model.body(root).name).tolist() == expected
    first, second = (model.body(int(number)).name for number in rng.integers(1, model.nbody, 2))
    both = subtree(model, first) | subtree(model, second)
    assert (subtree(model, first, second) == both).all()
    assert not subtree(model).any()
