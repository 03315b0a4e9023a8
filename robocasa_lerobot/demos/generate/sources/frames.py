"""What segments are relative to: objects, and the parts of fixtures that a stage is about, with their shapes.

A part's frame lies at the point of its surface that the hand works on, given by shares of the part's own box: a door
that is half as wide again is then pushed at the same share of its width. It has the part's axes, so that it moves with
the part and what is relative to it follows the arc of another hinge.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.generate.sources.transform import make_pose
from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Drawer
from robocasa_lerobot.envs.predicates.objects import middle_of
from robocasa_lerobot.envs.tasks.conditions import KNOB
from robocasa_lerobot.envs.tasks.task import Stage

HANDLE, REST = "handle", "rest"  # what of a part is touched
HEADS = ("raise_head", "lower_head")
UPRIGHT_AXIS = 0.5  # cosine from which on a hinge counts as vertical
BARE_M = 0.01  # half size of a part without a shape of its own
JOINTED = ("doors", "drawers", "racks", "knobs", "levers", "buttons")  # skills that are about parts


@dataclass(frozen=True)
class Part:
    """A jointed part of a fixture.

    Attributes:
        name: role of the fixture and the part's own, as `drawer.box`.
        body: its number.
        address: of its joint in qpos.
        range: of its joint, metres or radians, (2,).
        axis: of its joint in its own axes, (3,).
        slides: whether it is a slide.
        side: 1 if it reaches from a vertical hinge to the right, -1 to the left, 0 for all others.
        boxes: opposite corners (2, 3) of its handle and of the rest of it, in its own axes, metres.
        lever: of one that has no solid shape but that of bodies fixed to it, the middle of that, (3,) in its axes; a
            lever points elsewhere on another fixture. None of all others.
    """

    name: str
    body: int
    address: int
    range: Array
    axis: Array
    slides: bool
    side: int
    boxes: dict[str, Array]
    lever: Array | None = None

    def position(self, data: mujoco.MjData) -> float:
        """Of its joint, metres or radians."""
        return float(data.qpos[self.address])

    @property
    def span(self) -> float:
        """Of its joint's range, metres or radians."""
        return float(self.range[1] - self.range[0])


def body_pose(data: mujoco.MjData, body: int) -> Array:
    """World pose (4, 4) of a body."""
    return make_pose(data.xpos[body], data.xmat[body].reshape(3, 3))


def parts_of(env: KitchenEnv, stage: Stage) -> list[Part]:
    """The parts that a stage is about; none where it moves objects or drives."""
    if stage.skill not in JOINTED:
        return []
    fixture = env.scene.fixture(stage.target)
    return [_part(env, stage.target, fixture, joint) for joint in _joints(env, stage, fixture)]


def possible_parts(env: KitchenEnv, stage: Stage) -> list[Part]:
    """The parts that a stage may come to be about: of a knob that follows where something is put, all burners'."""
    if stage.skill != "knobs" or not stage.object:
        return parts_of(env, stage)
    hob = env.scene.fixture(stage.target, Hob)
    return [_part(env, stage.target, hob, hob.joint(f"{KNOB}{location}")) for location in hob.burners]


def _joints(env: KitchenEnv, stage: Stage, fixture: Fixture) -> list[str]:
    part = env.scene.fill(stage.part)
    if stage.skill == "drawers":
        return [env.scene.fixture(stage.target, Drawer).joint]
    if stage.skill == "doors" and stage.verb not in (*HEADS, "push_lid"):
        return [fixture.door_joint(name) for name in fixture.doors_of(part)]
    if stage.verb in HEADS:
        part = "head"
    elif stage.skill == "knobs" and stage.object:
        hob = env.scene.fixture(stage.target, Hob)
        point = middle_of(env.scene, env.data, env.scene.fill(stage.object))
        part = f"{KNOB}{hob.nearest_burner(env.data, point)[0]}"
    return [env.scene.fixture(stage.target, Appliance).joint(part)]


def _part(env: KitchenEnv, role: str, fixture: Fixture, joint: str) -> Part:
    model, hinge = env.model, env.model.joint(joint)
    body = int(model.jnt_bodyid[hinge.id])
    boxes = solid_boxes(model, body)
    whole = np.vstack(list(boxes.values()))
    slides = bool(model.jnt_type[hinge.id] == mujoco.mjtJoint.mjJNT_SLIDE)
    upright = not slides and abs(hinge.axis[2]) > UPRIGHT_AXIS
    reach = float(whole[:, 0].max() + whole[:, 0].min()) - 2.0 * float(hinge.pos[0])
    suffix = model.body(body).name.removeprefix(f"{fixture.name}_")
    return Part(
        name=f"{role}.{suffix}",
        body=body,
        address=int(hinge.qposadr[0]),
        range=np.array(hinge.range, dtype=np.float64),
        axis=np.array(hinge.axis, dtype=np.float64),
        slides=slides,
        side=int(np.sign(reach)) if upright and "door" in joint else 0,
        boxes=boxes,
        lever=_lever(env, body),
    )


def _lever(env: KitchenEnv, body: int) -> Array | None:
    """The middle of the solid shapes of bodies fixed to one, (3,) in its axes; None where it is solid itself."""
    model, data = env.model, env.data
    solid = _solid(model)
    below = env.scene.subtree(model.body(body).name)
    if solid[model.geom_bodyid == body].any() or not (mine := solid & below[model.geom_bodyid]).any():
        return None
    middle: Array = data.xmat[body].reshape(3, 3).T @ (data.geom_xpos[mine].mean(axis=0) - data.xpos[body])
    return middle


def _solid(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """For each shape whether it collides, (ngeom,)."""
    collides: NDArray[np.bool_] = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    return collides


def solid_boxes(model: mujoco.MjModel, body: int) -> dict[str, Array]:
    """Opposite corners (2, 3) of what collides of a body: of its handle, and of the rest, in its axes, metres.

    Where nothing of it collides, as where all of that belongs to bodies fixed to it, of what is seen of it.
    """
    corners: dict[str, list[Array]] = {}
    first = int(model.body_geomadr[body])
    own = np.arange(first, first + int(model.body_geomnum[body]))
    solid = own[_solid(model)[own]]
    for geom in (solid if len(solid) else own).tolist():
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
        axes, box = turn.reshape(3, 3), model.geom_aabb[geom]
        middle, half = model.geom_pos[geom] + axes @ box[:3], np.abs(axes) @ box[3:]
        group = HANDLE if HANDLE in model.geom(geom).name else REST
        corners.setdefault(group, []).extend([middle - half, middle + half])
    found = {group: np.array([np.min(ends, axis=0), np.max(ends, axis=0)]) for group, ends in corners.items()}
    return found or {REST: np.array([-np.full(3, BARE_M), np.full(3, BARE_M)])}


def shares_of(point: Array, box: Array) -> Array:
    """A point (3,) as shares of a box (2, 3), between 0 and 1."""
    size = np.maximum(box[1] - box[0], 1e-6)
    return np.clip((point - box[0]) / size, 0.0, 1.0)


def anchor(box: Array, shares: Array, *, mirror: bool = False) -> Array:
    """The point (3,) of a box (2, 3) at shares of it; of its mirror image's where it reaches to the other side."""
    at = shares * [-1.0, 1.0, 1.0] + [1.0, 0.0, 0.0] if mirror else shares
    point: Array = box[0] + at * (box[1] - box[0])
    return point


def anchored(part_pose: Array, point: Array) -> Array:
    """Frames (..., 4, 4) with a part's axes at a point (3,) of it, from the part's own poses."""
    return part_pose @ make_pose(point, np.eye(3))
