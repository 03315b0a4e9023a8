"""A bench for one appliance: a finger and a pincer that move its parts by contact forces alone.

Nothing here writes the position of an appliance's joint after the start: the finger is a ball on springs (3 N/mm, at
most 48 N), the pincer two pads that close with 20 N each, as the Panda's gripper does.
"""

from __future__ import annotations

import mujoco
import numpy as np

from robocasa_lerobot.contract import SUBSTEPS
from robocasa_lerobot.envs.kitchens.appliances.acting import ActingAppliances
from robocasa_lerobot.envs.kitchens.appliances.catalogue import build_appliance
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette, load_style
from robocasa_lerobot.envs.physics.options import apply_simulation_options
from robocasa_lerobot.envs.scene.bodies import subtree

FINGER_M = 0.008  # radius
SPRING, MOST_GIVE_M = 3000.0, 0.016
PARKED = np.array([0.0, -3.0, 3.0])
PAD_FORCE = 20.0


class Bench:
    def __init__(self, model_id: str, size=None) -> None:
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        apply_simulation_options(spec)
        spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        self.it = build_appliance(model_id, "it", (0.0, 0.0, 1.0), size=size)
        self.it.build(spec, MaterialPalette(spec, load_style(1)))
        if self.it.record.category == "blender":
            _add_table(spec, self.it)
        _add_finger(spec)
        _add_pincer(spec)
        self.model = spec.compile()
        self.acting = ActingAppliances([self.it], self.model)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.finger = subtree(self.model, "finger")
        self.toucher = self.finger
        self.mocap = int(self.model.body("finger").mocapid[0])
        self.way = np.zeros(3)  # that the finger pushes
        self.goal = PARKED.copy()  # of the finger's holder, reached at the end of a control step

    # Time -----------------------------------------------------------------------------------------------------

    def step(self, count: int = 1) -> None:
        """Control steps, each followed by what the appliance does by itself."""
        for _ in range(count):
            way = self.goal - self.data.mocap_pos[self.mocap]
            for _ in range(SUBSTEPS):
                self.data.mocap_pos[self.mocap] += way / SUBSTEPS
                mujoco.mj_step2(self.model, self.data)
                mujoco.mj_step1(self.model, self.data)
            self.acting.act(self.data, self.toucher)
            assert np.isfinite(self.data.qpos).all()

    def start(self, **shares: float) -> None:
        """Begin with parts at shares of their ranges."""
        mujoco.mj_resetData(self.model, self.data)
        for part, share in shares.items():
            self.it.set_share(self.data, part, share)
        self.park()
        mujoco.mj_forward(self.model, self.data)
        self.step(4)

    def state(self) -> dict[str, float | bool]:
        return self.it.state(self.data)

    def share(self, part: str) -> float:
        return self.it.share(self.data, part)

    # Finger ---------------------------------------------------------------------------------------------------

    def park(self) -> None:
        """Take finger and pincer away."""
        for part in ("finger", "pincer"):
            self.data.mocap_pos[self.model.body(part).mocapid[0]] = PARKED
        self.goal = PARKED.copy()
        self.data.ctrl[:] = 0.0
        for joint in ("finger_x", "finger_y", "finger_z", "pad_0", "pad_1", "pincer_lift", "pincer_turn"):
            self.data.joint(joint).qpos[0] = 0.0
            self.data.joint(joint).qvel[0] = 0.0

    def push(
        self, part: str, share: float, seconds: float = 12.0, tolerance: float = 0.012, leave: bool = True
    ) -> bool:
        """Push a part with the finger until it stands at a share of its range, from whatever side and spot works."""
        begin = self.data.qpos.copy(), self.data.qvel.copy(), self.data.userdata.copy(), self.data.eq_active.copy()
        joint = self.model.joint(self.it.joint(part))
        forwards = share > self.share(part)
        positive = forwards == bool(joint.range[0] >= 0)
        for geom, along in self._spots(part, joint.id):
            self.data.qpos[:], self.data.qvel[:], self.data.userdata[:], self.data.eq_active[:] = begin
            mujoco.mj_forward(self.model, self.data)
            if self._follow(part, geom, along, 1.0 if positive else -1.0, share, seconds, tolerance):
                if leave:
                    self.retreat()
                return True
            self.retreat()
        return False

    def press(self, button: str) -> bool:
        """Press a button for half a second with the finger, then take the finger away."""
        joint = self.model.joint(self.it.joint(button)).id
        for geom, along in self._spots(button, joint):
            self._follow(button, geom, along, 1.0, 2.0, 0.5, 0.0)
            pressed = self.share(button) > 0.75
            self.retreat()
            if pressed:
                return True
        return False

    def retreat(self) -> None:
        """Move the finger back the way that it came, then take it away."""
        for _ in range(8):
            self.goal = self.goal - self.way * 0.004
            self.step()
        self.park()
        self.step(2)

    def _spots(self, part: str, joint: int):
        """Places on a part to push at: the geoms that can be touched, farthest from a hinge first; then their ends."""
        moved = subtree(self.model, f"it_{part}")[self.model.geom_bodyid]
        geoms = np.flatnonzero(moved & (self.model.geom_contype > 0)).tolist()
        anchor, axis = self.data.xanchor[joint], self.data.xaxis[joint]

        def lever(geom: int) -> float:
            arm = self.data.geom_xpos[geom] - anchor
            return -float(np.linalg.norm(arm - axis * (arm @ axis)))

        if self.model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE:
            geoms.sort(key=lever)
        else:
            geoms.sort(key=lambda g: float(self.data.geom_xpos[g][1]))  # the frontmost first
        for geom in geoms:
            yield geom, np.zeros(3)
        # Off the middle, where posts or neighbours are in the way.
        for geom in geoms:
            size = self.model.geom_size[geom]
            if self.model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
                for axis_index in np.argsort(-size)[:2]:
                    for sign in (1, -1):
                        offset = np.zeros(3)
                        offset[axis_index] = sign * 0.8 * size[axis_index]
                        yield geom, offset
            else:
                for sign in (0.6, -0.6):
                    yield geom, np.array([0.0, 0.0, sign * size[1]])

    def _target(self, joint: int, geom: int, along: np.ndarray, sign: float) -> tuple[np.ndarray, np.ndarray]:
        """Where the finger touches the geom to push the joint on, and the direction of the way."""
        rotation = self.data.geom_xmat[geom].reshape(3, 3)
        spot = self.data.geom_xpos[geom] + rotation @ along
        axis = self.data.xaxis[joint]
        if self.model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE:
            way = np.cross(axis, spot - self.data.xanchor[joint])
        else:
            way = axis.copy()
        norm = np.linalg.norm(way)
        way = sign * way / max(norm, 1e-9)
        size, kind = self.model.geom_size[geom], self.model.geom_type[geom]
        local = np.abs(rotation.T @ way)
        if kind == mujoco.mjtGeom.mjGEOM_BOX:
            # From the spot straight through the box's face.
            reach = float(np.min(size / np.maximum(local, 1e-9)))
        elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
            reach = float(size[0] / max(np.hypot(local[0], local[1]), 0.3))
        else:
            reach = float(min(size[0] / max(np.hypot(local[0], local[1]), 1e-9), size[1] / max(local[2], 1e-9)))
        return spot - way * (reach + FINGER_M), way

    def _follow(
        self, part: str, geom: int, along: np.ndarray, sign: float, share: float, seconds: float, tolerance: float
    ) -> bool:
        joint = self.model.joint(self.it.joint(part)).id
        touch, way = self._target(joint, geom, along, sign)
        self.way = way
        self.goal = touch - way * 0.004
        self.data.mocap_pos[self.mocap] = self.goal
        mujoco.mj_forward(self.model, self.data)
        ball = self.model.geom("finger_ball").id
        for contact in range(self.data.ncon):
            pair = self.data.contact.geom[contact]
            if ball in pair and self.data.contact.dist[contact] < -0.0005:
                return False  # no room for a finger here
        press, last, still = 0.0, self.share(part), 0
        for _ in range(round(seconds * 20)):
            found = self.share(part)
            if sign_reached(found, share, tolerance):
                return True
            still = 0 if abs(found - last) > 0.002 else still + 1
            last = found
            if still > 24:
                return False  # this spot does not do
            touch, way = self._target(joint, geom, along, sign)
            self.way = way
            # Ahead of the part by what the springs give: no more than MOST_GIVE_M.
            press = min(press + 0.002, MOST_GIVE_M)
            goal = touch + way * press
            step = goal - self.goal
            self.goal = self.goal + step * min(1.0, 0.02 / max(float(np.linalg.norm(step)), 1e-9))
            self.step()
        return sign_reached(self.share(part), share, tolerance)

    # Pincer ---------------------------------------------------------------------------------------------------

    def twist(self, part: str, share: float, seconds: float = 6.0, tolerance: float = 0.03) -> bool:
        """Grip a knob from its front and turn it to a share of its range."""
        joint = self.model.joint(self.it.joint(part)).id
        low, high = self.model.jnt_range[joint]
        begin = self.share(part)
        axis = -self.data.xaxis[joint]  # outwards
        centre = self.data.xanchor[joint] + axis * 0.016
        side = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [0.0, 1.0, 0.0])
        side /= np.linalg.norm(side)
        frame = np.stack([side, np.cross(axis, side), axis], axis=1)
        if self._barred(joint):
            # The pads go to the sides of the grip.
            side = self.data.xmat[self.model.jnt_bodyid[joint]].reshape(3, 3)[:, 0]
            frame = np.stack([side, np.cross(axis, side), axis], axis=1)
        self.grip(centre, _quat(frame))
        turned, total = 0.0, (share - begin) * (high - low)
        for _ in range(round(seconds * 20)):
            if abs(self.share(part) - share) <= tolerance:
                break
            # The pincer turns by itself a little further than the knob should, since pads slip; outwards is -axis.
            turned += float(np.clip(total * 1.15 - turned, -0.08, 0.08))
            self.data.ctrl[self.model.actuator("turn").id] = -turned
            self.step()
        reached = abs(self.share(part) - share) <= tolerance
        self.let_go()
        return reached

    def grip(self, centre: np.ndarray, quat: np.ndarray) -> None:
        """Put the open pincer around a place and close it."""
        body = self.model.body("pincer")
        self.toucher = subtree(self.model, "pincer")
        self.data.mocap_pos[body.mocapid[0]] = centre
        self.data.mocap_quat[body.mocapid[0]] = quat
        self._pads(-PAD_FORCE)
        self.step(2)
        self._pads(PAD_FORCE)
        self.step(6)

    def let_go(self) -> None:
        """Open the pincer and take it away."""
        self._pads(-PAD_FORCE)
        self.step(4)
        self.toucher = self.finger
        self.park()
        self.step(2)

    def _pads(self, force: float) -> None:
        for index in range(2):
            self.data.ctrl[self.model.actuator(f"close_{index}").id] = force

    def _barred(self, joint: int) -> bool:
        body = self.model.jnt_bodyid[joint]
        return any(
            self.model.geom_bodyid[g] == body
            and self.model.geom_contype[g]
            and self.model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX
            for g in range(self.model.ngeom)
        )


def sign_reached(found: float, wanted: float, tolerance: float) -> bool:
    if wanted >= 1.0:
        return found >= 1.0 - tolerance
    if wanted <= 0.0:
        return found <= tolerance
    return abs(found - wanted) <= max(tolerance, 0.03)


def _quat(frame: np.ndarray) -> np.ndarray:
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(frame).ravel())
    return quat


def _add_table(spec: mujoco.MjSpec, it) -> None:
    """What a loose part falls on."""
    z = it.pos[2] - it.height / 2 - 0.05
    table = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=[0, 0, z], size=[2.0, 2.0, 0.05], name="table")
    table.contype, table.conaffinity = 2, 1


def _add_finger(spec: mujoco.MjSpec) -> None:
    root = spec.worldbody.add_body(name="finger", mocap=True, pos=PARKED.tolist())
    body = root
    for index, axis in enumerate(np.eye(3)):
        body = body.add_body(name=f"finger_{'xyz'[index]}_body", gravcomp=1.0)
        if index == 0:
            body.sleep = mujoco.mjtSleepPolicy.mjSLEEP_NEVER  # as a robot, which its actuators keep awake
        body.add_joint(name=f"finger_{'xyz'[index]}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis.tolist())
        body.joints[0].stiffness = [SPRING, 0, 0]
        body.joints[0].damping = [60.0, 0, 0]
        body.mass, body.explicitinertial = 0.3, True
        body.inertia = [1e-5, 1e-5, 1e-5]
    body.add_geom(
        name="finger_ball", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[FINGER_M, 0, 0], friction=[1.0, 0.05, 0.001]
    )


def _add_pincer(spec: mujoco.MjSpec) -> None:
    root = spec.worldbody.add_body(name="pincer", mocap=True, pos=PARKED.tolist())
    # Friction acts on velocities, and a mocap body has none: what turns and lifts are joints.
    for name, kind, stiffness, damping in (
        ("lift", mujoco.mjtJoint.mjJNT_SLIDE, 4000.0, 150.0),
        ("turn", mujoco.mjtJoint.mjJNT_HINGE, 30.0, 1.0),
    ):
        root = root.add_body(name=f"pincer_{name}", gravcomp=1.0)
        root.add_joint(name=f"pincer_{name}", type=kind, axis=[0, 0, 1], armature=0.05 if name == "lift" else 0.005)
        root.mass, root.explicitinertial = 0.05, True
        root.inertia = [1e-4, 1e-4, 1e-4]
        actuator = spec.add_actuator(
            name=name, target=f"pincer_{name}", trntype=mujoco.mjtTrn.mjTRN_JOINT, ctrlrange=[-10.0, 10.0]
        )
        actuator.set_to_position(kp=stiffness, kv=damping)
    for index, sign in enumerate((1.0, -1.0)):
        pad = root.add_body(name=f"pad_{index}_body", gravcomp=1.0)
        pad.add_joint(
            name=f"pad_{index}",
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=[-sign, 0, 0],
            range=[0.0, 0.04],
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            armature=0.1,
        )
        pad.joints[0].damping = [30.0, 0, 0]
        pad.mass, pad.explicitinertial = 0.05, True
        pad.inertia = [1e-5, 1e-5, 1e-5]
        # Opened to 80 mm.
        pad.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[sign * 0.044, 0, 0],
            size=[0.004, 0.009, 0.009],
            friction=[2.0, 0.05, 0.0001],
            name=f"pad_{index}_geom",
        )
        spec.add_actuator(
            name=f"close_{index}",
            target=f"pad_{index}",
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            ctrlrange=[-PAD_FORCE, PAD_FORCE],
        )
