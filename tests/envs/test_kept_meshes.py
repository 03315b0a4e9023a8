"""Meshes that generators keep: what is kept is what would be made, cannot be changed, and does not grow."""

from __future__ import annotations

import weakref

import numpy as np
import pytest

from robocasa_lerobot.envs.kitchens.appliances import meshes

PROFILE = [(0.02, 0.0), (0.05, 0.1)]


def test_a_kept_mesh_is_the_one_that_would_be_made() -> None:
    first = meshes.turned(PROFILE, 12, foot=False)
    assert meshes.turned([(0.02, 0.0), (0.05, 0.1)], 12, foot=False) is first
    again = meshes.turned(PROFILE, 11, foot=False)
    assert len(again.vertices) < len(first.vertices)
    assert meshes.turned(PROFILE, 12).faces.shape != first.faces.shape
    rings = [meshes.circle(0.1, z, 8) for z in (0.0, 0.2)]
    kept = meshes.loft(rings)
    rings[1][:, 2] += 0.1  # what it was made of may change
    assert np.ptp(kept.vertices[:, 2]) == pytest.approx(0.2)
    assert np.ptp(meshes.loft(rings).vertices[:, 2]) == pytest.approx(0.3)


def test_a_kept_mesh_cannot_be_changed() -> None:
    mesh = meshes.block((0.1, 0.1, 0.1), 0.01)
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        mesh.faces[0] = 0


def test_zeros_of_either_sign_make_meshes_of_their_own() -> None:
    """Equal as numbers, they give different bits, and a scene's bits must not hang on which came first."""
    above, below = ([meshes.circle(0.1, z, 8), meshes.circle(0.1, 0.2, 8)] for z in (0.0, -0.0))
    one, other = meshes.loft(above), meshes.loft(below)
    assert np.array_equal(one.vertices, other.vertices)
    assert one.vertices.tobytes() != other.vertices.tobytes()


def test_the_oldest_meshes_are_given_up() -> None:
    first = weakref.ref(meshes.disc(0.0123, 3))
    assert first() is not None
    for number in range(meshes.KEPT_MESHES):
        meshes.disc(0.2 + 1e-6 * number, 3)
    assert first() is None
