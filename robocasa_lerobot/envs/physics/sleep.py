"""Which bodies sleep, made known to MuJoCo."""

from __future__ import annotations

from numba import types

from robocasa_lerobot.envs.physics.native import compiled

# MuJoCo's own function, by its name in its library; `native.load()` makes it known before the first call.
_mj_updateSleep = types.ExternalFunction("mj_updateSleep", types.void(types.intp, types.intp))  # noqa: N816


@compiled
def update_sleep(model: int, data: int) -> None:
    """Make MuJoCo's lists of awake bodies follow `data.tree_asleep`; its Python package has no call for it."""
    _mj_updateSleep(model, data)
