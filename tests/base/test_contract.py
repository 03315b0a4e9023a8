"""The contract: its published names and numbers, and the properties of its conversions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from robocasa_lerobot import contract
from robocasa_lerobot.contract import ContractError

# The layout of RoboCasa365's LeRobot datasets (`modality.json`) and of its HDF5 files, written out here once
# more on purpose: a change of contract.py that leaves it is a change of the data format.
STATE_LAYOUT = {
    "base_position": (0, 3),
    "base_rotation": (3, 7),
    "end_effector_position_relative": (7, 10),
    "end_effector_rotation_relative": (10, 14),
    "gripper_qpos": (14, 16),
}
ACTION_LAYOUT = {
    "base_motion": (0, 4),
    "control_mode": (4, 5),
    "end_effector_position": (5, 8),
    "end_effector_rotation": (8, 11),
    "gripper_close": (11, 12),
}
HDF5_LAYOUT = {
    "end_effector_position": (0, 3),
    "end_effector_rotation": (3, 6),
    "gripper_close": (6, 7),
    "base_motion": (7, 11),
    "control_mode": (11, 12),
}


def rows(size: int) -> st.SearchStrategy[np.ndarray]:
    """Float arrays of shape (..., size) with no, one or two leading axes, some of them empty."""
    shapes = hnp.array_shapes(min_dims=0, max_dims=2, min_side=0, max_side=4).map(lambda lead: (*lead, size))
    dtypes = st.sampled_from([np.float32, np.float64])
    return dtypes.flatmap(lambda dtype: hnp.arrays(dtype, shapes, elements=st.floats(-4, 4, width=32)))


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (contract.STATE_SLICES, STATE_LAYOUT),
        (contract.ACTION_SLICES, ACTION_LAYOUT),
        (contract.ACTION_SLICES_HDF5, HDF5_LAYOUT),
    ],
)
def test_layouts_are_robocasas(found: dict[str, slice], expected: dict[str, tuple[int, int]]) -> None:
    assert {name: (where.start, where.stop) for name, where in found.items()} == expected
    assert list(found) == list(expected)


def test_names_and_rates_are_robocasas() -> None:
    assert contract.CAMERAS == ("robot0_agentview_left", "robot0_agentview_right", "robot0_eye_in_hand")
    assert contract.IMAGE_KEYS == tuple(f"observation.images.{camera}" for camera in contract.CAMERAS)
    assert (contract.STATE_KEY, contract.ACTION_KEY, contract.TASK_KEY) == ("observation.state", "action", "task")
    assert (contract.STATE_SIZE, contract.ACTION_SIZE, contract.IMAGE_SIZE) == (16, 12, 256)
    assert (contract.CONTROL_HZ, contract.VIDEO_FPS, contract.ROBOT_TYPE) == (20, 20, "PandaOmron")
    assert contract.CONTROL_HZ * contract.SUBSTEPS * contract.PHYSICS_TIMESTEP_S == pytest.approx(1.0)
    assert set(contract.STATE_PART_HDF5_KEYS) == set(STATE_LAYOUT)


@pytest.mark.parametrize("parts", [contract.STATE_PARTS, contract.ACTION_PARTS])
def test_component_names_are_unique(parts: tuple[contract.Part, ...]) -> None:
    names = contract.component_names(parts)
    assert len(names) == len(set(names)) == sum(part.size for part in parts)


def test_hdf5_order_by_example() -> None:
    # position 1 2 3, rotation 4 5 6, gripper 7, base 8 9 10, torso 11, mode 12
    stored = contract.hdf5_to_stored(np.arange(1, 13))
    assert stored.tolist() == [8, 9, 10, 11, 12, 1, 2, 3, 4, 5, 6, 7]


@given(rows(contract.ACTION_SIZE))
def test_action_orders_are_inverse(action: np.ndarray) -> None:
    for there, back in [
        (contract.hdf5_to_stored, contract.stored_to_hdf5),
        (contract.stored_to_hdf5, contract.hdf5_to_stored),
    ]:
        converted = there(action)
        assert converted.dtype == action.dtype
        assert converted.shape == action.shape
        assert np.array_equal(back(converted), action)


@given(rows(contract.ACTION_SIZE))
def test_conversion_keeps_every_named_part(action: np.ndarray) -> None:
    stored = contract.split_action(contract.hdf5_to_stored(action))
    for name, (start, stop) in HDF5_LAYOUT.items():
        assert np.array_equal(stored[name], action[..., start:stop])


@given(rows(contract.STATE_SIZE))
def test_state_splits_and_joins_to_itself(state: np.ndarray) -> None:
    assert np.array_equal(contract.join_state(contract.split_state(state)), state)


@given(rows(contract.ACTION_SIZE))
def test_action_splits_and_joins_to_itself(action: np.ndarray) -> None:
    assert np.array_equal(contract.join_action(contract.split_action(action)), action)


@given(rows(contract.ACTION_SIZE))
def test_binarize(action: np.ndarray) -> None:
    before = action.copy()
    out = contract.binarize(action)
    assert np.array_equal(action, before)
    for name, part in contract.split_action(out).items():
        given_part = contract.split_action(action)[name]
        if name in ("control_mode", "gripper_close"):
            assert np.array_equal(part, np.where(given_part >= 0.5, 1.0, -1.0))
        else:
            assert np.array_equal(part, given_part)
    assert np.array_equal(contract.binarize(out), out)


@pytest.mark.parametrize(("raw", "executed"), [(-1.0, -1.0), (0.0, -1.0), (0.49, -1.0), (0.5, 1.0), (1.0, 1.0)])
def test_both_conventions_of_a_binary_part_are_understood(raw: float, executed: float) -> None:
    action = np.zeros(contract.ACTION_SIZE)
    action[contract.ACTION_SLICES["gripper_close"]] = raw
    assert contract.binarize(action)[-1] == executed


@given(rows(4))
def test_canonical_quaternion(quaternion: np.ndarray) -> None:
    out = contract.canonical_quaternion(quaternion)
    assert (out[..., 3] >= 0).all()
    same = np.all(out == quaternion, axis=-1)
    opposite = np.all(out == -quaternion, axis=-1)
    assert (same | opposite).all()


@pytest.mark.parametrize(
    "function",
    [
        contract.hdf5_to_stored,
        contract.stored_to_hdf5,
        contract.split_state,
        contract.split_action,
        contract.binarize,
        contract.canonical_quaternion,
    ],
)
@pytest.mark.parametrize("shape", [(), (0,), (7,), (12, 3), (2, 17)])
def test_wrong_size_is_an_error(function: object, shape: tuple[int, ...]) -> None:
    assert callable(function)
    with pytest.raises(ContractError, match="expected"):
        function(np.zeros(shape))


def test_missing_part_is_an_error_and_never_zeros() -> None:
    parts = contract.split_state(np.ones(contract.STATE_SIZE))
    for name in parts:
        with pytest.raises(ContractError, match=name):
            contract.join_state({key: value for key, value in parts.items() if key != name})


def test_misspelt_part_names_the_closest() -> None:
    parts = contract.split_action(np.ones(contract.ACTION_SIZE))
    parts["griper_close"] = parts.pop("gripper_close")
    with pytest.raises(ContractError, match="'gripper_close'"):
        contract.join_action(parts)


def test_dataset_features_are_lerobots() -> None:
    features = contract.dataset_features((64, 96))
    assert set(features) == {*contract.IMAGE_KEYS, "observation.state", "action"}
    for key in contract.IMAGE_KEYS:
        assert features[key] == {"dtype": "video", "shape": (64, 96, 3), "names": ["height", "width", "channel"]}
    for key, size in (("observation.state", 16), ("action", 12)):
        assert features[key]["dtype"] == "float64"
        assert features[key]["shape"] == (size,)
        assert len(features[key]["names"]) == size
