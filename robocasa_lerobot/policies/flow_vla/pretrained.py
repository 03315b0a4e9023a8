"""A prefix from a pretrained vision-language model of `transformers`: SmolVLM or PaliGemma, by name or folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from torch import Tensor, nn

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.policies.common.transfer import without_weights
from robocasa_lerobot.policies.flow_vla.configuration_flow_vla import FlowVlaConfig
from robocasa_lerobot.policies.flow_vla.prefix import Prefix

# Of each kind: the modules that see (vision model, then what joins it to the language model) and the one that reads.
PARTS = {
    "smolvlm": ("vision_model", "connector", "text_model"),
    "paligemma": ("vision_tower", "multi_modal_projector", "language_model"),
}
LANGUAGE_MODELS = ("llama", "gemma")  # their layers, norms and rotary positions are what the expert goes with


class PretrainedPrefix(Prefix):
    """The language model of a SmolVLM or PaliGemma reads what its vision model sees.

    Weights come from `prefix_path`; from a checkpoint, whose configuration holds `prefix_config`, they come with the
    checkpoint.

    Raises:
        UserError: nothing loadable there, another kind of model, or an image size that it cannot take.
    """

    def __init__(self, config: FlowVlaConfig) -> None:
        super().__init__(config)
        model = _build(config.prefix_config) if config.prefix_config else _load(config)
        self.hf_config = model.config
        _check_layers(config, model.config.text_config.num_hidden_layers)
        see, join, read = PARTS[model.config.model_type]
        self.vision, self.connector = getattr(model, see), getattr(model, join)
        self.language_model = getattr(model, read)
        self.image_size = _image_size(config, model.config)
        self._keep_what_is_read()
        for unread in ("head", "vision_model.head"):  # pooling: where it lies depends on the version
            _without_gradients(self.vision, unread)

    def embed_images(self, images: Tensor) -> Tensor:
        """Pictures as tokens of the language model."""
        images = images.to(next(self.vision.parameters()).dtype)
        seen = self.vision(pixel_values=images).last_hidden_state
        return self.connector(seen)

    def embed_words(self, tokens: Tensor) -> Tensor:
        """The tokenizer's tokens (B, W) as vectors."""
        return self.language_model.get_input_embeddings()(tokens)

    def parts(self) -> dict[str, list[nn.Module]]:
        """The modules of `vision` and of `language`."""
        return {"vision": [self.vision, self.connector], "language": [self.language_model]}

    def checkpoint_config(self) -> dict[str, Any]:
        """The model's own configuration."""
        settings: dict[str, Any] = self.hf_config.to_dict()
        settings.pop("_name_or_path", None)  # where this machine had it
        return settings


def _check_layers(config: FlowVlaConfig, there: int) -> None:
    """Check that the language model is as deep as is asked for: a checkpoint's cannot be made otherwise."""
    if config.prefix_layers not in (None, there):
        raise UserError(
            f"prefix_layers is {config.prefix_layers}, but the checkpoint's language model has {there} layers, which "
            f"it keeps. Put {there} back, or train from `prefix_path` anew."
        )


def _load(config: FlowVlaConfig) -> Any:
    from transformers import AutoConfig, AutoModel

    path = config.prefix_path
    try:
        wanted = AutoConfig.from_pretrained(path)
        _check_kind(wanted, path)
        if config.prefix_layers is not None:
            there = wanted.text_config.num_hidden_layers
            if not 1 <= config.prefix_layers <= there:
                raise UserError(f"prefix_layers is {config.prefix_layers}, but {path!r} has {there}; use 1 to {there}.")
            wanted.text_config.num_hidden_layers = config.prefix_layers
        if without_weights():
            return AutoModel.from_config(wanted, dtype="float32")
        return AutoModel.from_pretrained(path, config=wanted, dtype="float32")
    except (OSError, ValueError) as error:
        if isinstance(error, UserError):
            raise
        kind = "folder" if Path(path).exists() else "hub name or folder"
        raise UserError(
            f"the vision-language model could not be loaded from {kind} {path!r}: {error} Set prefix_path to a folder "
            "that holds a SmolVLM or PaliGemma and its tokenizer (as `save_pretrained` writes it), allow access to the "
            "hub (PaliGemma's licence has to be accepted there), or set prefix to 'scratch', which needs no download."
        ) from error


def _build(settings: dict[str, Any]) -> Any:
    """The model without its weights, which the checkpoint brings."""
    from transformers import AutoConfig, AutoModel

    settings = dict(settings)
    return AutoModel.from_config(AutoConfig.for_model(settings.pop("model_type"), **settings), dtype="float32")


def _check_kind(config: Any, path: str) -> None:
    text = getattr(getattr(config, "text_config", None), "model_type", None)
    if config.model_type not in PARTS or text not in LANGUAGE_MODELS:
        raise UserError(
            f"{path!r} holds a {config.model_type!r} model with a {text!r} language model, expected "
            f"{' or '.join(repr(k) for k in PARTS)} with {' or '.join(repr(k) for k in LANGUAGE_MODELS)}."
        )


def _image_size(config: FlowVlaConfig, model: Any) -> tuple[int, int]:
    trained = int(model.vision_config.image_size)
    if config.image_size is None:
        return trained, trained
    height, width = config.image_size
    patch = int(model.vision_config.patch_size)
    if model.model_type == "paligemma":
        if (height, width) != (trained, trained):
            raise UserError(
                f"image_size is {[height, width]}, but this PaliGemma takes {trained}x{trained} only; set it to null."
            )
        return trained, trained
    step = patch * int(model.scale_factor)
    if height != width or height % step or not 0 < height <= trained:
        raise UserError(
            f"image_size is {[height, width]}, but this SmolVLM takes squares of a multiple of {step} up to {trained} "
            "pixels; set it to one of them, or to null for the largest."
        )
    return height, width


def _without_gradients(module: nn.Module, name: str) -> None:
    """Freeze a submodule whose output is not used, where there is one."""
    for step in name.split("."):
        found = getattr(module, step, None)
        if not isinstance(found, nn.Module):
            return
        module = found
    module.requires_grad_(False)
