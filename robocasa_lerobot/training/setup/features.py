"""What a checkpoint's policy takes in and gives out, and the features of the data: names, sizes, and the ones left out.

The features of a checkpoint are slots: their names mean nothing to its weights, their order and sizes do. `rename` of a
policy's settings therefore gives the slots the data's names, and a policy trained from there, evaluated or run with
`lerobot-eval` has these names and no other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lerobot.configs.policies import PreTrainedConfig
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.utils.constants import ACTION, OBS_STATE
from lerobot.utils.feature_utils import dataset_to_policy_features

from robocasa_lerobot.data.mixture import MixtureMeta
from robocasa_lerobot.errors import UnknownNameError, UserError

RENAME, LEAVE_OUT = "rename", "leave_out"
# Sizes to which policies pad shorter states and actions.
_PADDED = {FeatureType.STATE: "max_state_dim", FeatureType.ACTION: "max_action_dim"}
# Settings of policies that bring pictures of any size to their own.
_RESIZES = ("image_resolution", "resize_imgs_with_padding")


def renamed_inputs(
    inputs: Mapping[str, Any], rename: Mapping[str, str], leave_out: Sequence[str], checkpoint: str
) -> dict[str, Any]:
    """A checkpoint's inputs under the data's names, in the checkpoint's order, without those that stay empty.

    Args:
        inputs: the checkpoint's, by name.
        rename: name in the data: name in the checkpoint. A checkpoint that has the data's name already is left alone.
        leave_out: inputs of the checkpoint that the data fill with nothing.
        checkpoint: for errors.

    Raises:
        UserError: an input that the checkpoint does not have, or two of the data for one of it.
    """
    for field, value, kind in ((RENAME, rename, Mapping), (LEAVE_OUT, leave_out, list | tuple)):
        names = [*value, *value.values()] if isinstance(value, Mapping) else value
        if not isinstance(value, kind) or not all(isinstance(name, str) for name in names):
            what = "names in the data with names in the checkpoint" if field == RENAME else "a list of names"
            raise UserError(f"`{field}` of the policy's settings is {value!r}, expected {what}.")
    if len(set(rename.values())) < len(rename):
        raise UserError(f"`{RENAME}` of the policy gives two features to one of the checkpoint's: {dict(rename)}.")
    new = new_names(inputs, rename)
    for name in [*new, *(leave_out if new else ())]:
        if name not in inputs:
            raise UnknownNameError("input of the checkpoint", name, inputs, f"(in the policy's settings; {checkpoint})")
    for name in leave_out:
        if name in new:
            raise UserError(f"{name!r} is in `{RENAME}` and in `{LEAVE_OUT}` of the policy's settings; expected one.")
    kept = [name for name in inputs if name not in leave_out]
    return {new.get(name, name): inputs[name] for name in kept}


def new_names(inputs: Mapping[str, Any], rename: Mapping[str, str]) -> dict[str, str]:
    """The data's names of the checkpoint's inputs that get one, by the checkpoint's name."""
    return {theirs: mine for mine, theirs in rename.items() if mine not in inputs}


def take_features(config: PreTrainedConfig, meta: MixtureMeta, settings: Mapping[str, Any]) -> None:
    """Give a policy that is yet to be made the features that it will have of data, under its settings' other names."""
    found = dataset_to_policy_features(meta.features)
    config.output_features = {key: feature for key, feature in found.items() if feature.type is FeatureType.ACTION}
    inputs = config.input_features or {key: found[key] for key in found if key not in config.output_features}
    rename, left_out = settings.get(RENAME) or {}, settings.get(LEAVE_OUT) or []
    config.input_features = renamed_inputs(inputs, rename, left_out, "as the first phase makes it")


def check_features(config: PreTrainedConfig, meta: MixtureMeta, whose: str = "the checkpoint's policy") -> None:
    """Check that the data have what the policy takes in and gives out, in sizes that fit it.

    Args:
        config: the policy's.
        meta: of the data.
        whose: the policy, for errors.

    Raises:
        UserError: the data lack something, or have another size that the policy does not pad or scale.
    """
    found = dataset_to_policy_features(meta.features)
    for key, wanted in {**(config.input_features or {}), **(config.output_features or {})}.items():
        if key not in found:
            raise UnknownNameError(
                "feature",
                key,
                found,
                f"({whose} needs it; the data lack it; say in the policy's settings which of the data's "
                f"it is, `{RENAME}: {{<name in the data>: {key}}}`, or `{LEAVE_OUT}: [{key}]`)",
            )
        if not _fits(config, found[key], wanted):
            remedy = "Take data of the same robot and actions, or start `from_scratch`."
            if wanted.type is FeatureType.VISUAL:
                remedy = "Set `loader.image_size` to the policy's size."
            raise UserError(
                f"feature {key!r}: {whose} has shape {tuple(wanted.shape)}, the data {tuple(found[key].shape)}. "
                f"{remedy}"
            )


def _fits(config: PreTrainedConfig, found: PolicyFeature, wanted: PolicyFeature) -> bool:
    if tuple(found.shape) == tuple(wanted.shape):
        return True
    if found.type is FeatureType.VISUAL:
        return any(getattr(config, name, None) is not None for name in _RESIZES)
    largest = getattr(config, _PADDED.get(found.type, ""), None)
    return isinstance(largest, int) and len(found.shape) == 1 and found.shape[0] <= largest


def fit_features(config: PreTrainedConfig, meta: MixtureMeta) -> None:
    """Give the policy's features the sizes of the data, so that padding is what the policy does by itself."""
    found = dataset_to_policy_features(meta.features)
    config.input_features = {key: found.get(key, feature) for key, feature in (config.input_features or {}).items()}
    config.output_features = {key: found.get(key, feature) for key, feature in (config.output_features or {}).items()}
    if hasattr(config, "action_feature_names") and meta.features.get(ACTION, {}).get("names") is not None:
        config.action_feature_names = list(meta.features[ACTION]["names"])


def check_kept_statistics(checkpoint: Mapping[str, Any], meta: MixtureMeta) -> None:
    """Check that a checkpoint's statistics can be those of the data: states and actions of the same sizes.

    Args:
        checkpoint: its config.json.
        meta: of the data.

    Raises:
        UserError: they are of other states or actions.
    """
    found = dataset_to_policy_features(meta.features)
    kept = {**(checkpoint.get("input_features") or {}), **(checkpoint.get("output_features") or {})}
    for key in (OBS_STATE, ACTION):
        if key in kept and key in found and tuple(kept[key]["shape"]) != tuple(found[key].shape):
            raise UserError(
                f"`statistics: keep`: the checkpoint has {key!r} of shape {tuple(kept[key]['shape'])}, the data "
                f"{tuple(found[key].shape)}: its statistics are of something else. Set `statistics: replace`."
            )
