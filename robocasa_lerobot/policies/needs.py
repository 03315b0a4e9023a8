"""What policies need: LeRobot's beyond this installation, for errors that say so; ours of LeRobot's extras."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.importing import POLICY_PACKAGES


@dataclass(frozen=True)
class Need:
    """What a policy type needs to be built: an extra of LeRobot (or none), weights, and what to do without the hub."""

    extra: str | None
    weights: str
    remedy: str


_IMAGENET = Need(
    None,
    "the ImageNet weights of its ResNet (45 MB, from torchvision)",
    "set pretrained_backbone_weights to null to start from random ones, or allow access to them",
)
_PALIGEMMA = "the tokenizer of google/paligemma-3b-pt-224 (its licence has to be accepted on the hub)"
_PI_REMEDY = "allow access to the hub, and log in to it with the account that accepted the licence"
NEEDS: dict[str, Need] = {
    "act": _IMAGENET,
    "diffusion": Need("diffusion", _IMAGENET.weights, _IMAGENET.remedy),
    "multi_task_dit": Need(
        "multi_task_dit",
        "a CLIP model with its tokenizer (openai/clip-vit-base-patch16)",
        "set vision_encoder_name and text_encoder_name to a folder with 'clip' in its name that holds them, or allow "
        "access to the hub",
    ),
    "smolvla": Need(
        "smolvla",
        "a SmolVLM with its processor (HuggingFaceTB/SmolVLM2-500M-Video-Instruct)",
        "set vlm_model_name to a folder that holds them, or allow access to the hub",
    ),
    "xvla": Need(
        "xvla",
        "published weights to start from (lerobot/xvla-base, which bring florence_config) and the tokenizer "
        "facebook/bart-large",
        "start the phase from a folder that holds the weights, set tokenizer_name to one that holds the tokenizer, or "
        "allow access to the hub",
    ),
    "pi0": Need("pi", f"published weights to start from (lerobot/pi0_base) and {_PALIGEMMA}", _PI_REMEDY),
    "pi05": Need("pi", f"published weights to start from (lerobot/pi05_base) and {_PALIGEMMA}", _PI_REMEDY),
    "groot": Need(
        "groot",
        "the weights of nvidia/GR00T-N1.7-3B and a GPU",
        "set base_model_path to a folder that holds them, or allow access to the hub",
    ),
}
# What LeRobot imports where it is installed; ours use diffusers' samplers, but LeRobot's imports of it are others'.
OTHERS_PACKAGES = (*POLICY_PACKAGES, "datasets", "scipy")


def needs_no_others(config: Mapping[str, Any], steps: Collection[str]) -> bool:
    """Whether a policy computes its actions with a LeRobot that lacks `OTHERS_PACKAGES`.

    Ours with a text encoder of its own does; CLIP, language models and LeRobot's tokenizers come with transformers, and
    adapters of LoRA with peft.

    Args:
        config: of its checkpoint (config.json).
        steps: names of the steps of its saved processors.
    """
    return (
        config.get("type") == "diffusion_transformer"
        and config.get("text_encoder") == "token"
        and not config.get("use_peft")
        and not any("tokenizer" in name for name in steps)
    )


@contextmanager
def explained(kind: str) -> Iterator[None]:
    """Errors of building a policy of type `kind`, or its processors, as ones that name what it needs.

    Raises:
        UserError: something could not be imported, found or loaded; the original error is its cause.
    """
    try:
        yield
    except UserError:
        raise
    except (ImportError, OSError, ValueError) as error:
        if kind not in NEEDS:
            raise
        need = NEEDS[kind]
        extra = f"the extra lerobot[{need.extra}] and " if need.extra else ""
        reason = " ".join(str(error).split()).rstrip(".")
        raise UserError(
            f"the policy {kind!r} could not be built: {reason}. It needs {extra}{need.weights}: {need.remedy}."
        ) from error
