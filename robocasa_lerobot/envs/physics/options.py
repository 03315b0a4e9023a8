"""Options of every simulation: RoboCasa's."""

from __future__ import annotations

import mujoco

from robocasa_lerobot.contract import PHYSICS_TIMESTEP_S


def apply_simulation_options(spec: mujoco.MjSpec) -> None:
    """Set time step, integrator, contact and solver options to RoboCasa's."""
    option = spec.option
    option.timestep = PHYSICS_TIMESTEP_S
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.iterations = 100
    option.impratio = 20.0
    option.density = 1.2  # of air, kg/m^3
    option.viscosity = 2.0e-5  # of air, Pa s
    # Several contacts per pair of convex shapes: on, whether MuJoCo's flag enables or disables it.
    if hasattr(mujoco.mjtEnableBit, "mjENBL_MULTICCD"):
        option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_MULTICCD)
    if hasattr(mujoco.mjtDisableBit, "mjDSBL_MULTICCD"):
        option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_MULTICCD)
    # A simulation that is lost must be an error (`control_step` raises it), not a silent return to the zero state.
    option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    spec.visual.map.znear = 0.001
