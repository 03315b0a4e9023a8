"""Faces of boxes that nobody sees: against other boxes, at any turn, and the edges of what is thin as a line."""

from __future__ import annotations

import numpy as np
import pytest

from robocasa_lerobot.envs.rendering.hidden_faces import shown_faces

LEFT, RIGHT, FRONT, BACK, BOTTOM, TOP = range(6)


def hidden(boxes, turn: float = 0.0) -> list[set[int]]:
    """Faces that are hidden of each box, given as middle and half sizes; all turned together about z."""
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    positions, halves = (np.array([box[i] for box in boxes], dtype=float) for i in range(2))
    shown = shown_faces(positions @ rotation.T, np.tile(rotation, (len(boxes), 1, 1)), halves)
    return [set(np.flatnonzero(~row).tolist()) for row in shown]


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_what_lies_against_something_larger_is_hidden(turn: float) -> None:
    wall, board = ((0, 1, 0), (2, 0.1, 2)), ((0, 0.8, 0), (0.3, 0.1, 0.3))
    assert hidden([wall, board], turn) == [set(), {BACK}]
    # A millimetre apart there is something to see.
    assert hidden([wall, ((0, 0.799, 0), (0.3, 0.1, 0.3))], turn) == [set(), set()]
    # One that stands out at a side hides nothing of itself.
    assert hidden([wall, ((1.9, 0.8, 0), (0.3, 0.1, 0.3))], turn) == [set(), set()]


def test_neighbours_of_one_size_hide_each_other() -> None:
    assert hidden([((0, 0, 0), (0.1, 0.2, 0.3)), ((0.2, 0, 0), (0.1, 0.2, 0.3))]) == [{RIGHT}, {LEFT}]


def test_faces_in_one_plane_stay() -> None:
    tall, low = ((0, 0, 0), (0.2, 0.2, 0.2)), ((0, 0, -0.1), (0.1, 0.2, 0.1))
    assert hidden([tall, low]) == [set(), {LEFT, RIGHT, TOP}]


def test_lines_show_their_broad_faces() -> None:
    assert hidden([((0, 0, 0), (0.2, 0.0008, 0.2))]) == [{LEFT, RIGHT, BOTTOM, TOP}]
    assert hidden([((0, 0, 0), (0.2, 0.0012, 0.2))]) == [set()]
    assert hidden([((0, 0, 0), (0.2, 0.0008, 0.0008))]) == [set()]  # a wire has no broad faces
