"""The policies of this project, and the one function that makes them known to LeRobot."""

from __future__ import annotations

import importlib

from robocasa_lerobot.errors import UserError

POLICY_TYPES: tuple[str, ...] = ("diffusion_transformer", "flow_vla")


def register_policies() -> None:
    """Import what registers our policy types, and the processor steps that their saved pipelines name."""
    for kind in POLICY_TYPES:
        for part in ("configuration", "processor"):
            importlib.import_module(f"robocasa_lerobot.policies.{kind}.{part}_{kind}")


def register_policy_type(kind: str) -> None:
    """Import what registers policy type `kind` with LeRobot: ours by its name, else installed plugins.

    Raises:
        UserError: nothing registers it.
    """
    from lerobot.configs.policies import PreTrainedConfig

    if kind in POLICY_TYPES:
        register_policies()
    if kind not in PreTrainedConfig.get_known_choices():
        from lerobot.utils.import_utils import register_third_party_plugins

        register_third_party_plugins()
    if kind not in PreTrainedConfig.get_known_choices():
        known = ", ".join(sorted(PreTrainedConfig.get_known_choices()))
        raise UserError(f"policy type {kind!r} is not registered; known: {known}. Install the package that has it.")
