"""A tiny Gemma for LeRobot's pi0 and pi0.5, whose smallest own networks take more memory than a test machine has.

The one place where something is put into LeRobot for the walk through all experiments: Python imports this file at its
start where this folder is on PYTHONPATH, and nothing else does. It adds the variant `gemma_tiny` to those that the two
configurations know; sizes of the picture encoder and the vocabulary, which LeRobot fixes, follow from it. Everything
else is theirs.
"""

from __future__ import annotations

import importlib
import importlib.abc
import importlib.util
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import Any

VARIANT = "gemma_tiny"
WIDTH, WORDS = 32, 512
MODULES = {
    f"lerobot.policies.{kind}.{part}_{kind}" for kind in ("pi0", "pi05") for part in ("configuration", "modeling")
}


def known_to_configuration(module: ModuleType) -> None:
    """Let the configuration of `module` take the variant: it compares with the two names that it knows."""
    kind = next(value for name, value in vars(module).items() if name in ("PI0Config", "PI05Config"))
    check = kind.__post_init__

    def checked(self: Any) -> None:
        own = {name: getattr(self, name) for name in ("paligemma_variant", "action_expert_variant")}
        for name, value in own.items():
            setattr(self, name, "gemma_300m" if value == VARIANT else value)
        check(self)
        for name, value in own.items():
            setattr(self, name, value)

    kind.__post_init__ = checked


def known_to_model(module: Any) -> None:
    """Let the networks of `module` be made of the variant."""
    own, paligemma = module.get_gemma_config, module.PaliGemmaForConditionalGenerationWithPiGemma
    gemma = module.PiGemmaForCausalLM

    def get_gemma_config(variant: str) -> Any:  # eight heads are written into the networks
        if variant != VARIANT:
            return own(variant)
        return module.GemmaConfig(width=WIDTH, depth=2, mlp_dim=WIDTH, num_heads=8, num_kv_heads=1, head_dim=8)

    class Sized(paligemma):  # type: ignore[misc, valid-type]
        def __init__(self, config: Any) -> None:
            if config.text_config.hidden_size == WIDTH:
                vision = {"hidden_size": WIDTH, "intermediate_size": WIDTH, "projection_dim": WIDTH}
                for name, value in {**vision, "num_hidden_layers": 1, "num_attention_heads": 2}.items():
                    setattr(config.vision_config, name, value)
                config.text_config.vocab_size = WORDS
            super().__init__(config)

    class SizedExpert(gemma):  # type: ignore[misc, valid-type]
        def __init__(self, config: Any) -> None:
            if config.hidden_size == WIDTH:
                config.vocab_size = WORDS
            super().__init__(config)

    module.PiGemmaForCausalLM = SizedExpert
    module.get_gemma_config = get_gemma_config
    module.PaliGemmaForConditionalGenerationWithPiGemma = Sized


class _WhenImported(importlib.abc.MetaPathFinder):
    """Registers the variant as soon as the modules are imported, and imports nothing by itself."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> Any:
        if name not in MODULES:
            return None
        sys.meta_path.remove(self)
        try:
            spec = importlib.util.find_spec(name)
        finally:
            sys.meta_path.insert(0, self)
        if spec is None or spec.loader is None:
            return None
        execute = spec.loader.exec_module

        def exec_module(module: ModuleType) -> None:
            execute(module)
            (known_to_configuration if ".configuration_" in name else known_to_model)(module)

        spec.loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec


sys.meta_path.insert(0, _WhenImported())
