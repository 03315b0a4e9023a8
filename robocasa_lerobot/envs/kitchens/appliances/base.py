"""What every appliance shares: its record, its states, and what it does by itself once per control step.

A state that is seen or that a goal asks for is the position of a joint: a door, a knob, or a lamp that is shown and
hidden. Recorded joint positions therefore tell it. Times and earlier contacts are kept in MuJoCo's user data, and
catches that hold a lever in `eq_active`: both are part of the integration state that `KitchenState` carries.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.appliances.parts import Parts
from robocasa_lerobot.envs.kitchens.appliances.records import ModelRecord
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette
from robocasa_lerobot.envs.physics.whole_state import read_physics, write_physics

# A door counts as open, or as closed, by these shares of its range (docs/robocasa.md, section 7).
OPEN_FROM, CLOSED_UP_TO = 0.90, 0.005
RACK_DOOR_FROM = 0.99  # the door must be this open for a rack to slide
_AWAKE = -(1 + 10)  # of `tree_asleep`: awake, and 10 quiet steps (mjMINAWAKE) away from sleep


class Touches:
    """Which bodies something touches in the present state.

    Args:
        model, data: with contacts evaluated.
        toucher: for each body whether it belongs to what touches, (nbody,).

    Attributes:
        bodies: numbers of those that it touches.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, toucher: NDArray[np.bool_]) -> None:
        self.bodies: frozenset[int] = frozenset()
        if data.ncon == 0:
            return
        bodies = model.geom_bodyid[data.contact.geom]
        mine = toucher[bodies]
        touching = data.contact.dist <= 0.0
        self.bodies = frozenset(bodies[(mine[:, ::-1] & ~mine) & touching[:, None]].tolist())

    def body(self, number: int) -> bool:
        """Whether a body is touched."""
        return number in self.bodies


@dataclass(frozen=True)
class Standing:
    """Where an appliance stands in the rows of layouts.

    Attributes:
        where: "counter", on it; "floor", between counters; "under_counter", flush with the cabinets; or "built_in",
            where rows have a place of their own for it.
        back_m: on the floor, of its back from the wall, metres.
        name: of the fixture; its kind if empty.
        tiled: on the floor, whether the tiles of the wall go on behind it.
    """

    where: str = "counter"
    back_m: float = 0.0
    name: str = ""
    tiled: bool = False


@dataclass
class Appliance(Fixture):
    """A fixture made from a model record.

    Attributes:
        record: the model.
        standing: where it stands in a row.
        memory_slots: numbers that it keeps in user data.
        looks: states worth a picture: shares of range by part.
    """

    record: ModelRecord = field(kw_only=True)
    standing: ClassVar[Standing] = Standing()
    memory_slots: ClassVar[int] = 0
    looks: ClassVar[dict[str, dict[str, float]]] = {"": {}}
    _memory_at: int = field(default=-1, init=False, repr=False)
    _places: dict[str, tuple[int, int, float, float]] = field(default_factory=dict, init=False, repr=False)
    _places_of: Any = field(default=None, init=False, repr=False)
    _changed: bool = field(default=False, init=False, repr=False)

    def build(self, spec: mujoco.MjSpec, palette: MaterialPalette) -> None:
        """Add bodies, joints and geoms to the spec."""
        if self.memory_slots:
            self._memory_at = spec.nuserdata
            spec.nuserdata += self.memory_slots
        self.assemble(Parts(spec, palette, self.name, self.record.split), self.root_body(spec))

    @abstractmethod
    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add everything that stands on the root body."""

    # What tasks and placement ask ------------------------------------------------------------------------------

    @property
    def doors(self) -> tuple[str, ...]:
        """Parts that are doors."""
        return ()

    @property
    def is_ground(self) -> bool:
        """Whether it stands on the floor."""
        return self.standing.where == "floor"

    @property
    def door_names(self) -> tuple[str, ...]:
        """Parts that are doors."""
        return self.doors

    def door_share(self, data: mujoco.MjData, door: str) -> float:
        """How far a door is open, as a share of its range."""
        return self.share(data, door)

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """Shares of ranges of doors, racks, knobs and levers, and whether it, or a part of it, is on."""
        return {part: self.share(data, part) for part in self.doors}

    def is_open(self, data: mujoco.MjData) -> bool:
        """Whether every door is open by at least 0.90 of its range."""
        return all(self.share(data, part) >= OPEN_FROM for part in self.doors)

    def is_closed(self, data: mujoco.MjData) -> bool:
        """Whether every door is open by at most 0.005 of its range."""
        return all(self.share(data, part) <= CLOSED_UP_TO for part in self.doors)

    def set_openness(self, data: mujoco.MjData, openness: float, part: str = "") -> None:
        """Open the doors of a part, or all, by a share of their ranges; for initial states."""
        for door in self.doors_of(part):
            self.set_share(data, door, openness)

    def set_on(self, data: mujoco.MjData, on: bool) -> None:
        """Switch it on or off; for initial states."""
        raise AssertionError(f"{self.name} has nothing to switch it on with")

    def set_rack(self, data: mujoco.MjData, share: float, rack: str) -> None:
        """Slide a rack or drawer out by a share of its range; doors that block it are opened. For initial states."""
        if share > 0.0:
            for door in self.doors:
                if self.share(data, door) < RACK_DOOR_FROM:
                    self.set_share(data, door, 1.0)
        self.set_share(data, rack, share)

    # Joints ----------------------------------------------------------------------------------------------------

    def joint(self, part: str) -> str:
        """Name of a part's joint."""
        return f"{self.name}_{part}_joint"

    def position(self, data: mujoco.MjData, part: str) -> float:
        """Position of a part's joint, radians or metres."""
        return float(data.qpos[self._place(data, part)[0]])

    def share(self, data: mujoco.MjData, part: str) -> float:
        """Position of a part as a share of its range; from the other end where the range begins below zero."""
        address, _, low, high = self._place(data, part)
        share = (float(data.qpos[address]) - low) / (high - low)
        return 1.0 - share if low < 0 else share

    def set_share(self, data: mujoco.MjData, part: str, share: float) -> None:
        """Put a part at a share of its range; for initial states. Evaluate positions afterwards."""
        _, _, low, high = self._place(data, part)
        share = 1.0 - share if low < 0 else share
        self.set_position(data, part, low + share * (high - low))

    def set_position(self, data: mujoco.MjData, part: str, position: float) -> None:
        """Put a part's joint at a position, radians or metres; for initial states."""
        address, dof, _, _ = self._place(data, part)
        data.qpos[address], data.qvel[dof] = position, 0.0

    def _place(self, data: mujoco.MjData, part: str) -> tuple[int, int, float, float]:
        """Index into qpos and qvel of a part's joint, and its range; looked up once, since this is asked often."""
        if self._places_of is not data.model:
            self._places_of, self._places = data.model, {}
        if part not in self._places:
            joint = data.model.joint(self.joint(part))
            low, high = (float(v) for v in joint.range)
            self._places[part] = (int(joint.qposadr[0]), int(joint.dofadr[0]), low, high)
        return self._places[part]

    def lit(self, data: mujoco.MjData, part: str) -> bool:
        """Whether a lamp is shown."""
        return self.share(data, part) > 0.5

    def memory(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """Its numbers in user data; writing to them writes there."""
        assert self._memory_at >= 0, f"{self.name} has not been built"
        view: NDArray[np.float64] = data.userdata[self._memory_at : self._memory_at + self.memory_slots]
        return view

    # What it does by itself ------------------------------------------------------------------------------------

    def update(self, model: mujoco.MjModel, data: mujoco.MjData, contacts: Touches) -> bool:
        """Latches and timers, once per control step; returns whether positions or catches changed.

        After a change `take_effect` must evaluate the state anew; `ActingAppliances` does so once for all of them.
        """
        self._changed = False
        self.react(model, data, contacts)
        return self._changed

    def react(self, model: mujoco.MjModel, data: mujoco.MjData, contacts: Touches) -> None:
        """What the category does; see `update`.

        It may look at its own joints, at what touches its bodies, its memory and its catches, and at nothing else:
        where all of these are as they were when no appliance did anything, none is asked (`ActingAppliances`).
        """

    def touched(self, model: mujoco.MjModel, contacts: Touches, part: str) -> bool:
        """Whether the gripper touches a part."""
        return contacts.body(model.body(f"{self.name}_{part}").id)

    def show(self, data: mujoco.MjData, part: str, share: float) -> None:
        """Show a lamp (1), hide it (0), or show a part of it."""
        position = share * self._place(data, part)[3]
        if self.position(data, part) != position:
            self.set_position(data, part, position)
            self._changed = True

    def catch(self, model: mujoco.MjModel, data: mujoco.MjData, part: str, held: bool) -> None:
        """Close or open the catch of a part."""
        number = model.equality(f"{self.name}_{part}_hold").id
        if bool(data.eq_active[number]) != held:
            data.eq_active[number] = held
            self.wake(model, data, part)

    def wake(self, model: mujoco.MjModel, data: mujoco.MjData, part: str) -> None:
        """Let a part move that may be asleep."""
        tree = int(model.dof_treeid[self._place(data, part)[1]])
        self._changed = True
        # What sleeps together is a cycle of numbers.
        while data.tree_asleep[tree] >= 0:
            data.tree_asleep[tree], tree = _AWAKE, int(data.tree_asleep[tree])


def take_effect(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Evaluate a state whose joint positions or catches were written, with what sleeps."""
    write_physics(model, data, *read_physics(model, data))
