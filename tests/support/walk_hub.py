"""A folder that stands for the hub's cache: the models that experiments name, tiny and with random weights.

Files, names of features and formats are those of the published repositories; `python walk_hub.py FOLDER` writes them,
with `tiny_gemma` on PYTHONPATH. With HF_HOME=FOLDER and HF_HUB_OFFLINE=1 everything finds them by their own names.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch

COMMIT = "0" * 40
WORDS = ("open", "close", "the", "left", "drawer", "pick", "place", "counter", "sink", ".", ",", ":", "task", "state")
VISION = {"type": "VISUAL", "shape": [3, 224, 224]}
PI_CAMERAS = ("base_0_rgb", "left_wrist_0_rgb", "right_wrist_0_rgb")
QWEN = ("<|image_pad|>", "<|video_pad|>", "<|vision_start|>", "<|vision_end|>", "<|im_start|>", "<|im_end|>")
CHAT = (
    "{% for message in messages %}<|im_start|>{{ message.role }} {% for part in message.content %}"
    "{% if part.type == 'image' %}<|vision_start|><|image_pad|><|vision_end|>{% else %}{{ part.text }}{% endif %}"
    "{% endfor %}<|im_end|>{% endfor %}"
)


def write_hub(home: Path) -> None:
    """Write all repositories into the cache `home`/hub."""
    torch.manual_seed(0)
    for name, write in REPOSITORIES.items():
        repository = home / "hub" / f"models--{name.replace('/', '--')}"
        snapshot = repository / "snapshots" / COMMIT
        snapshot.mkdir(parents=True)
        (repository / "refs").mkdir()
        (repository / "refs/main").write_text(COMMIT)
        write(snapshot)


def write_tokenizer(folder: Path, special: tuple[str, ...] = (), **settings: Any) -> Any:
    """A tokenizer of a few words; the special ones come first."""
    from tokenizers import Tokenizer, models, pre_tokenizers
    from transformers import PreTrainedTokenizerFast

    words = [*special, "[UNK]", "[PAD]", "<s>", "</s>", *WORDS]
    tokenizer = Tokenizer(models.WordLevel({word: i for i, word in enumerate(words)}, unk_token="[UNK]"))
    tokenizer.pre_tokenizer = pre_tokenizers.Whitespace()
    names = {"unk_token": "[UNK]", "pad_token": "[PAD]", "bos_token": "<s>", "eos_token": "</s>"}
    out = PreTrainedTokenizerFast(
        tokenizer_object=tokenizer, **names, additional_special_tokens=list(special), **settings
    )
    out.save_pretrained(folder)
    return out


def write_clip(folder: Path) -> None:
    from transformers import CLIPConfig, CLIPModel

    small = {"hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 1, "num_attention_heads": 2}
    vision = {**small, "image_size": 32, "patch_size": 16, "projection_dim": 8}
    ids = {"pad_token_id": 1, "bos_token_id": 2, "eos_token_id": 3}
    text = {**small, "vocab_size": 64, "max_position_embeddings": 77, "projection_dim": 8, **ids}
    CLIPModel(CLIPConfig(text_config=text, vision_config=vision, projection_dim=8)).save_pretrained(folder)
    write_tokenizer(folder)


def write_pi(kind: str) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        from lerobot.configs.policies import PreTrainedConfig
        from lerobot.configs.types import FeatureType, PolicyFeature
        from lerobot.policies.factory import get_policy_class, make_policy_config
        from sitecustomize import VARIANT

        cameras = {
            f"observation.images.{name}": PolicyFeature(FeatureType.VISUAL, tuple(VISION["shape"]))
            for name in PI_CAMERAS
        }
        config: PreTrainedConfig = make_policy_config(
            kind,
            input_features={**cameras, "observation.state": PolicyFeature(FeatureType.STATE, (32,))},
            output_features={"action": PolicyFeature(FeatureType.ACTION, (32,))},
            paligemma_variant=VARIANT,
            action_expert_variant=VARIANT,
            device="cpu",
            push_to_hub=False,
        )
        get_policy_class(kind)(config).save_pretrained(folder)

    return write


def write_paligemma(folder: Path) -> None:
    from transformers import PaliGemmaConfig

    write_tokenizer(folder)
    PaliGemmaConfig().save_pretrained(folder)  # says which tokenizer it is; its weights are never loaded


def qwen_config() -> Any:
    from transformers import Qwen3VLConfig

    names = ("image_token_id", "video_token_id", "vision_start_token_id", "vision_end_token_id")
    ids = {name: number for number, name in enumerate(names)}  # as the first of QWEN
    text = {
        "hidden_size": 32, "intermediate_size": 32, "num_hidden_layers": 2, "num_attention_heads": 2,
        "num_key_value_heads": 1, "head_dim": 16, "vocab_size": 64, "max_position_embeddings": 4096,
        "rope_scaling": {"mrope_interleaved": True, "mrope_section": [4, 2, 2], "rope_type": "default"},
    }  # fmt: skip
    vision = {
        "depth": 2, "hidden_size": 32, "intermediate_size": 32, "num_heads": 2, "out_hidden_size": 32,
        "patch_size": 16, "deepstack_visual_indexes": [0, 1],
    }  # fmt: skip
    return Qwen3VLConfig(text_config=text, vision_config=vision, **ids)


def write_groot(folder: Path) -> None:
    """The raw format of the published repository: no LeRobot configuration, its backbone named in config.json."""
    from lerobot.policies.groot.groot_n1_7 import GR00TN17, GR00TN17Config

    attention = {"num_attention_heads": 2, "attention_head_dim": 16, "dropout": 0.2, "final_dropout": True}
    diffusion = {
        **attention, "positional_embeddings": None, "num_layers": 2, "norm_type": "ada_norm", "output_dim": 32,
        "interleave_self_attention": True,
    }  # fmt: skip
    config = GR00TN17Config(
        model_name=TINY_BACKBONE,
        architectures=["Gr00tN1d7"],
        select_layer=2,
        backbone_embedding_dim=32,
        hidden_size=32,
        input_embedding_dim=32,
        diffusion_model_cfg=diffusion,
        vl_self_attention_cfg={**attention, "positional_embeddings": None, "num_layers": 1},
    )
    backbone = {"cache_dir": str(folder.parents[2])}  # where the tiny backbone's configuration was written before
    GR00TN17(config, transformers_loading_kwargs=backbone, load_backbone_weights=False).save_pretrained(folder)


def write_cosmos(folder: Path) -> None:
    """Tokenizer and processors of GR00T's backbone; LeRobot asks for them by this name whatever the weights are."""
    from transformers import Qwen2VLImageProcessor, Qwen3VLVideoProcessor

    tokens = {"image_token": QWEN[0], "video_token": QWEN[1], "vision_bos_token": QWEN[2], "vision_eos_token": QWEN[3]}
    write_tokenizer(folder, QWEN, extra_special_tokens=tokens, chat_template=CHAT)
    sizes = {"patch_size": 16, "merge_size": 2, "temporal_patch_size": 2}
    Qwen2VLImageProcessor(**sizes, min_pixels=32 * 32, max_pixels=256 * 256).save_pretrained(folder)
    Qwen3VLVideoProcessor(**sizes).save_pretrained(folder)
    qwen_config().save_pretrained(folder)  # says which tokenizer it is


TINY_BACKBONE = "nvidia/Cosmos-Reason2-tiny"  # the name of the published one stands for its published sizes
REPOSITORIES: dict[str, Callable[[Path], None]] = {
    "openai/clip-vit-large-patch14": write_clip,
    "google/paligemma-3b-pt-224": write_paligemma,
    "lerobot/pi0_base": write_pi("pi0"),
    "lerobot/pi05_base": write_pi("pi05"),
    TINY_BACKBONE: lambda folder: qwen_config().save_pretrained(folder),
    "nvidia/Cosmos-Reason2-2B": write_cosmos,
    "nvidia/GR00T-N1.7-3B": write_groot,
}

if __name__ == "__main__":
    write_hub(Path(sys.argv[1]))
