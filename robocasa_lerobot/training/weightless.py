"""Policies built without the weights that they load: their sizes, and what a step of theirs takes, need none.

Policies load parts of them by name as they are built: CLIP, SmolVLM, PaliGemma, GR00T. Inside `without_weights` such a
part is built from its architecture alone. That comes from a folder, from what was downloaded before, or for the models
that our presets name from `architectures.json`, whose values are those of the config.json on the hub. Nothing is
downloaded.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

from robocasa_lerobot.errors import UserError

_DATA = Path(__file__).with_name("architectures.json")


def policy_architecture(name: str) -> dict[str, Any]:
    """Settings of a policy on the hub that decide its sizes beside the type's defaults; none where it is not known."""
    return dict(_known()["policies"].get(name, {}))


def architecture(path: str) -> Any:
    """The configuration of a model of `transformers`, by folder or hub name, without a download.

    Raises:
        UserError: it is neither there nor known.
    """
    from huggingface_hub import try_to_load_from_cache
    from transformers import AutoConfig

    file: Any = Path(path) / "config.json"
    if not file.is_file():
        file = None if Path(path).is_absolute() else try_to_load_from_cache(path, "config.json")
    if isinstance(file, str | Path):
        settings = json.loads(Path(file).read_text(encoding="utf-8"))
    elif path in _known()["models"]:
        settings = dict(_known()["models"][path])
    else:
        raise UserError(
            f"the architecture of {path!r} is not known here, so it cannot be sized without a download; "
            f"`hf download {path} config.json` gets it, or give a folder."
        )
    return AutoConfig.for_model(settings.pop("model_type"), **settings)


@contextmanager
def without_weights() -> Iterator[None]:
    """Inside, `transformers` builds models from their architecture where it would load them, and downloads nothing.

    Weights are random, or none on the device `meta`; processors are stand-ins that only building a policy can use.
    """
    import huggingface_hub.constants
    import transformers

    with ExitStack() as stack:
        replace = functools.partial(_replace, stack)
        stack.enter_context(mock.patch.object(huggingface_hub.constants, "HF_HUB_OFFLINE", True))
        replace(transformers.PreTrainedModel, _model)
        for auto in (transformers.AutoModel, transformers.AutoModelForImageTextToText):
            replace(auto, _auto_model)
        replace(transformers.AutoConfig, lambda _, path, **__: architecture(str(path)))
        replace(transformers.AutoProcessor, lambda *_, **__: _processor())
        _replace_groot(stack)
        yield


def _replace(stack: ExitStack, owner: type, function: Any) -> None:
    stack.enter_context(mock.patch.object(owner, "from_pretrained", classmethod(function)))


def _replace_groot(stack: ExitStack) -> None:
    """GR00T's own loading, which asks the hub before `transformers` is; its sizes are in LeRobot."""
    from lerobot.policies.groot.groot_n1_7 import GR00TN17, GR00TN17Config

    def build(cls: Any, pretrained_model_name_or_path: str, **settings: Any) -> Any:
        tuned = {name: settings.pop(name) for name in ("tune_visual", "tune_llm")}
        trained = {name: settings.pop(name) for name in ("tune_projector", "tune_diffusion_model", "tune_vlln")}
        for name in ("transformers_loading_kwargs", "load_backbone_weights"):
            settings.pop(name, None)
        config = _groot_config(pretrained_model_name_or_path, GR00TN17Config)
        for name, value in settings.items():
            setattr(config, name, value)
        model = cls(config, load_backbone_weights=False)
        model.backbone.set_trainable_parameters(**tuned, tune_top_llm_layers=config.tune_top_llm_layers)
        model.action_head.set_trainable_parameters(**trained)
        return model

    _replace(stack, GR00TN17, build)


def _groot_config(path: str, kind: Any) -> Any:
    file = Path(path) / "config.json"
    return kind(**json.loads(file.read_text(encoding="utf-8"))) if file.is_file() else kind()


def _model(cls: Any, path: str, *_: Any, config: Any = None, **__: Any) -> Any:
    """A model of one class: of a CLIP's architecture, the tower that the class is."""
    config = architecture(str(path)) if config is None else config
    wanted = cls.config_class
    if not isinstance(config, wanted):
        parts = [getattr(config, name, None) for name in ("text_config", "vision_config")]
        config = next((part for part in parts if isinstance(part, wanted)), config)
    return cls(config)


def _auto_model(cls: Any, path: str, *_: Any, config: Any = None, **settings: Any) -> Any:
    dtype = settings.get("dtype", settings.get("torch_dtype"))
    config = architecture(str(path)) if config is None else config
    return cls.from_config(config, **({} if dtype is None else {"dtype": dtype}))


def _processor() -> Any:
    return SimpleNamespace(tokenizer=SimpleNamespace(fake_image_token_id=0, global_image_token_id=0))


@functools.cache
def _known() -> Mapping[str, Any]:
    data: dict[str, Any] = json.loads(_DATA.read_text(encoding="utf-8"))
    return data
