"""The policies of this project, and the one way to make them known to LeRobot."""

from __future__ import annotations

import importlib

POLICY_TYPES: tuple[str, ...] = ("diffusion_transformer", "flow_vla")


def register_policies() -> None:
    """Import what registers our policy types, and the processor steps that their saved pipelines name."""
    for kind in POLICY_TYPES:
        for part in ("configuration", "processor"):
            importlib.import_module(f"robocasa_lerobot.policies.{kind}.{part}_{kind}")
