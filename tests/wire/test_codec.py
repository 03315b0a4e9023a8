"""Arrays cross the wire in every dialect of the field, and nothing that is not an array does."""

from __future__ import annotations

import io
import pickle
from typing import get_args

import msgpack
import numpy as np
import pytest

from robocasa_lerobot.wire.codec import Dialect, WireError, decode, encode

DIALECTS = get_args(Dialect)
ARRAYS = [
    np.arange(12, dtype=np.float32).reshape(3, 4),
    np.zeros((2, 0, 3), np.uint8),
    np.array(3.5),
    np.array([True, False]),
    np.arange(8, dtype=np.int64)[::2],
    np.asfortranarray(np.arange(6, dtype=np.float64).reshape(2, 3)),
    np.arange(4, dtype=">f4"),
]


@pytest.mark.parametrize("dialect", DIALECTS)
def test_arrays_scalars_and_plain_values_come_back_equal(dialect: Dialect) -> None:
    message = {"arrays": ARRAYS, "prompt": "öffne", "scalar": np.float32(0.5), "none": None, "nested": {"a": [1, 2.5]}}
    read = decode(encode(message, dialect))
    assert read["prompt"] == "öffne"
    assert read["nested"] == {"a": [1, 2.5]}
    assert read["none"] is None
    assert float(read["scalar"]) == 0.5
    for sent, back in zip(ARRAYS, read["arrays"], strict=True):
        assert back.dtype == sent.dtype
        assert back.shape == sent.shape
        np.testing.assert_array_equal(back, sent)
        assert not back.flags.writeable


def test_golden_bytes_of_the_four_dialects() -> None:
    array = np.array([1, 2], np.uint8)
    assert encode(array, "openpi") == (
        b"\x84\xc4\x0b__ndarray__\xc3\xc4\x04data\xc4\x02\x01\x02\xc4\x05dtype\xa3|u1\xc4\x05shape\x91\x02"
    )
    assert encode(array, "vla_eval") == (
        b"\x84\xab__ndarray__\xc3\xa4data\xc4\x02\x01\x02\xa5dtype\xa3|u1\xa5shape\x91\x02"
    )
    assert encode(array, "msgpack_numpy") == (
        b"\x85\xc4\x02nd\xc3\xc4\x04type\xa3|u1\xc4\x04kind\xc4\x00\xc4\x05shape\x91\x02\xc4\x04data\xc4\x02\x01\x02"
    )
    assert encode(array, "gr00t").startswith(b"\x82\xb1__ndarray_class__\xc3\xa6as_npy\xc4\x82\x93NUMPY")


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize(
    "array", [np.array([object()]), np.array(["text"]), np.array([1j]), np.zeros(1, [("a", "i4")])]
)
def test_what_is_no_number_is_not_sent(dialect: Dialect, array: np.ndarray) -> None:
    with pytest.raises(WireError, match="cannot be sent"):
        encode({"a": array}, dialect)


def test_text_in_npy_bytes_becomes_lists() -> None:
    npy = io.BytesIO()
    np.save(npy, np.array([["open the drawer"]]))
    message = msgpack.packb({"__ndarray_class__": True, "as_npy": npy.getvalue()})
    assert decode(message) == [["open the drawer"]]


def npy(descr: str, shape: str, data: bytes = b"", version: int = 1) -> bytes:
    """A message of an array in `numpy.save`'s bytes whose header says what it likes."""
    header = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}}}".encode()
    as_npy = b"\x93NUMPY" + bytes([version, 0]) + len(header).to_bytes(2, "little") + header + data
    return bytes(msgpack.packb({"__ndarray_class__": True, "as_npy": as_npy}))


@pytest.mark.parametrize(
    ("message", "why"),
    [
        (npy("<U0", "(1000000000000,)"), "is refused"),
        (npy("|S0", "(1000000000000,)"), "is refused"),
        (npy("|V0", "(1000000000000,)"), "is refused"),
        (npy("|O", "(1000000000000,)"), "is refused"),
        (npy("<f4", "(-1,)"), "is refused"),
        (npy("<f4", "(1000000000000,)", b"1234"), "4 bytes, not 4000000000000"),
        (npy("<f4", "(1,)", b"12345678"), "8 bytes, not 4"),
        (npy("<U1", "(1000000000000, 0)"), "nothing in more than"),
        (npy("<f4", "(1000000000000, 0)"), "nothing in more than"),
        (npy("<U1", "(200000,)", b"a\0\0\0" * 200_000), "texts of arrays"),
        (npy("<U1", "(100, 300, 0, 100)"), "nothing in more than"),
        (npy("<U1", "(100, 999, 0)"), "texts of arrays"),
        (npy("<f4", "(1,)", b"1234", version=3), "cannot be read"),
    ],
)
def test_npy_bytes_that_promise_more_than_there_is_are_refused_unread(message: bytes, why: str) -> None:
    with pytest.raises(WireError, match=why):
        decode(message)


def test_rows_without_end_of_nothing_are_refused() -> None:
    array = {"__ndarray__": True, "dtype": "<f4", "shape": [2**40, 0], "data": b""}
    with pytest.raises(WireError, match="nothing in more than"):
        decode(msgpack.packb(array))


class _Bomb:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return exec, ("raise SystemExit('a pickle was executed')",)


def test_pickles_are_refused_and_never_executed() -> None:
    npy = io.BytesIO()
    np.save(npy, np.array([_Bomb()], dtype=object), allow_pickle=True)
    bombs = [
        {"nd": True, "type": "|O", "kind": b"O", "shape": [1], "data": pickle.dumps(_Bomb())},
        {b"nd": True, b"type": "|O", b"kind": b"O", b"shape": [1], b"data": pickle.dumps(_Bomb())},
        {"nd": True, "type": "|O", "kind": b"", "shape": [1], "data": b"\0" * 8},
        {"__ndarray__": True, "dtype": "|O", "shape": [1], "data": b"\0" * 8},
        {"__ndarray_class__": True, "as_npy": npy.getvalue()},
    ]
    for bomb in bombs:
        with pytest.raises(WireError):
            decode(msgpack.packb({"observation": bomb}))


@pytest.mark.parametrize(
    "broken",
    [
        {"__ndarray__": True},
        {"__ndarray__": True, "dtype": "<f4", "shape": [2], "data": b"1234"},
        {"__ndarray__": True, "dtype": "<f4", "shape": [-1], "data": b"1234"},
        {"__ndarray__": True, "dtype": "<f4", "shape": [2**62, 2**62], "data": b"1234"},
        {"__ndarray__": True, "dtype": "nonsense", "shape": [1], "data": b"1234"},
        {"__ndarray__": True, "dtype": 5, "shape": [1], "data": b"1234"},
        {"__npgeneric__": True, "dtype": "|O", "data": 1},
        {"__ndarray_class__": True, "as_npy": b"\x93NUMPY broken"},
        {"__ndarray_class__": True},
    ],
)
def test_broken_arrays_say_what_was_found(broken: dict[str, object]) -> None:
    with pytest.raises(WireError, match=r"an array|the dtype"):
        decode(msgpack.packb(broken))


def test_what_is_no_msgpack_or_too_large_is_an_error() -> None:
    for data in (b"", b"\xc1", b"\xdf\xff\xff\xff\xff", msgpack.packb([1]) + b"rest", b"\x91" * 5000):
        with pytest.raises(WireError):
            decode(data)
    for one in (b"\x80", b"\x90"):  # each an empty map or list
        with pytest.raises(WireError, match="maps and lists"):
            decode(b"\xdd" + (2**20).to_bytes(4, "big") + one * 2**20)
    with pytest.raises(WireError, match="at most 10"):
        decode(msgpack.packb("a" * 100), max_bytes=10)
