"""Files that a checkpoint has its weights in."""

from __future__ import annotations

from pathlib import Path

WEIGHTS = "model.safetensors"
_ADAPTER = "adapter_model.safetensors"  # of PEFT, which needs the policy that it was trained beside


def adapter_alone(pretrained: Path) -> str | None:
    """What to do with a `pretrained_model` folder that has an adapter in the place of weights; None of any other."""
    if (pretrained / WEIGHTS).is_file() or not (pretrained / _ADAPTER).is_file():
        return None
    return (
        f"it holds an adapter of PEFT alone ({_ADAPTER}). Merge it into its policy and save that: "
        "`PeftModel.from_pretrained(policy, folder).merge_and_unload().save_pretrained(...)`."
    )
