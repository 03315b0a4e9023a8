"""A picture from beginning to end, compiled: what is in view, which triangle is seen where, and its colour."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.physics.native import compiled
from robocasa_lerobot.envs.rendering.software.arrays import (
    OPAQUE,
    Array,
    Kept,
    Numbers,
    Picture,
    Pose,
    Scratch,
    Shapes,
    Single,
    View,
)
from robocasa_lerobot.envs.rendering.software.occlusion import is_hidden
from robocasa_lerobot.envs.rendering.software.rasterization import NOTHING, to_camera, visible
from robocasa_lerobot.envs.rendering.software.shading import shade

KEEP_NOTHING, KEEP, USE_KEPT = 0, 1, 2
_LAYS = 2  # MuJoCo lays what is transparent over the picture twice, as pictures show


@compiled
def draw(
    shapes: Shapes,
    pose: Pose,
    scratch: Scratch,
    view: View,
    edges: Array,
    far_m: float,
    keeping: int,
    kept: Kept,
    picture: Picture,
) -> None:
    """Draw rows of what a camera sees into `picture`, (height, width, 3), upright.

    The picture is the same whatever is kept, and however its rows are shared out.

    Args:
        shapes: of the model.
        pose: the state, as the camera sees it.
        scratch: for at least as many pixels.
        view: the rows.
        edges: distances, metres, between the parts of a view that are drawn one after the other, the nearest first.
        far_m: distance from the camera's plane, metres, up to which is drawn.
        keeping: `KEEP_NOTHING`, `KEEP` or `USE_KEPT`.
        kept: what stands still, of the whole picture; its rows are written with `KEEP`.
        picture: written.
    """
    pixels = (view.end_row - view.first_row) * view.width
    inverse, seen, over = scratch.inverse[:pixels], scratch.seen[:pixels], scratch.over_seen[:pixels]
    everything = (view.first_row, view.end_row, 0, view.width)
    rows = slice(view.first_row * view.width, view.end_row * view.width)
    scratch.is_lit[:] = False
    opaque, transparent = _in_view(shapes, pose, view, edges)
    if keeping == USE_KEPT:
        inverse[:] = kept.inverse[rows]
        seen[:] = kept.seen[rows]
        picture[view.first_row : view.end_row] = kept.colours[view.first_row : view.end_row]
    else:
        inverse[:] = 1.0 / far_m
        seen[:] = NOTHING
        picture[view.first_row : view.end_row] = 0
        chosen = opaque if keeping == KEEP_NOTHING else opaque[kept.is_in[opaque]]
        _see(chosen, shapes, pose, scratch, view, inverse, seen)
        shade(everything, seen, shapes, pose, scratch, view, picture)
    if keeping == KEEP:
        kept.inverse[rows] = inverse
        kept.seen[rows] = seen
        kept.colours[view.first_row : view.end_row] = picture[view.first_row : view.end_row]
    if keeping != KEEP_NOTHING:
        _see(opaque[~kept.is_in[opaque]], shapes, pose, scratch, view, inverse, seen)
        for pixel in range(pixels):
            over[pixel] = seen[pixel] if seen[pixel] != kept.seen[rows.start + pixel] else NOTHING
        shade(everything, over, shapes, pose, scratch, view, picture)
    shown = np.empty(len(transparent), dtype=np.bool_)
    for number, geom in enumerate(transparent):
        shown[number] = not is_hidden(geom, shapes, pose, view, inverse)
        if shown[number]:
            to_camera(geom, shapes, pose, scratch)
    for _ in range(_LAYS):
        for geom in transparent[shown]:
            _lay_over(geom, shapes, pose, scratch, view, picture)


@compiled
def _see(
    geoms: Numbers, shapes: Shapes, pose: Pose, scratch: Scratch, view: View, inverse: Single, seen: Numbers
) -> None:
    """Note where these geoms are seen."""
    for geom in geoms:
        to_camera(geom, shapes, pose, scratch)
        first, end = shapes.first_face[geom], shapes.first_face[geom + 1]
        visible(first, end, True, shapes.faces, scratch.corners, pose.lens, view, inverse, seen)


@compiled
def _in_view(shapes: Shapes, pose: Pose, view: View, edges: Array) -> tuple[Numbers, Numbers]:
    """Geoms that reach into the view: the opaque from the nearest to the farthest, the others from the farthest on."""
    focal_x, focal_y, middle_x, middle_y, near = pose.lens
    left, right = -middle_x / focal_x, (view.width - middle_x) / focal_x
    top, bottom = (middle_y - view.first_row) / focal_y, (middle_y - view.end_row) / focal_y
    long_left, long_right = np.sqrt(1.0 + left * left), np.sqrt(1.0 + right * right)
    long_top, long_bottom = np.sqrt(1.0 + top * top), np.sqrt(1.0 + bottom * bottom)
    count = len(shapes.reach)
    layers = np.full(count, -1, dtype=np.int32)
    distances = np.zeros(count)
    transparent = 0
    axes = pose.axes
    for geom in range(count):
        if pose.looks[geom, 3] == 0.0:
            continue
        x, y, z = (
            pose.positions[geom, 0] - pose.eye[0],
            pose.positions[geom, 1] - pose.eye[1],
            pose.positions[geom, 2] - pose.eye[2],
        )
        across, up = axes[0] * x + axes[3] * y + axes[6] * z, axes[1] * x + axes[4] * y + axes[7] * z
        ahead = -(axes[2] * x + axes[5] * y + axes[8] * z)
        reach = shapes.reach[geom]
        if reach > 0.0 and (
            ahead < near - reach
            or left * ahead - across > reach * long_left
            or across - right * ahead > reach * long_right
            or up - top * ahead > reach * long_top
            or bottom * ahead - up > reach * long_bottom
        ):
            continue
        if pose.looks[geom, 3] < OPAQUE:
            layers[geom] = len(edges) + 2
            distances[geom] = reach - np.sqrt(x * x + y * y + z * z)
            transparent += 1
        elif shapes.is_backdrop[geom]:
            layers[geom] = len(edges) + 1
        else:
            turn, box = pose.rotations[geom], shapes.bounds[geom]
            square = 0.0
            for k in range(3):
                off = -(turn[k] * x + turn[k + 3] * y + turn[k + 6] * z) - box[k]
                outside = max(abs(off) - box[k + 3], 0.0)
                square += outside * outside
            layers[geom] = np.searchsorted(edges, np.sqrt(square)) if reach > 0.0 else len(edges)
    opaque = np.empty(count, dtype=np.int32)
    end = 0
    for layer in range(len(edges) + 2):
        for geom in range(count):
            if layers[geom] == layer:
                opaque[end] = geom
                end += 1
    through = np.empty(transparent, dtype=np.int32)
    left_out = np.flatnonzero(layers == len(edges) + 2)
    for k, place in enumerate(np.argsort(distances[left_out], kind="mergesort")):
        through[k] = left_out[place]
    return opaque[:end], through


@compiled
def _lay_over(geom: int, shapes: Shapes, pose: Pose, scratch: Scratch, view: View, picture: Picture) -> None:
    """Lay a transparent geom over the picture, triangle by triangle: each lets through what lies behind it."""
    focal_x, focal_y, middle_x, middle_y, near = pose.lens
    width, corners, faces = view.width, scratch.corners, shapes.faces
    for face in range(shapes.first_face[geom], shapes.first_face[geom + 1]):
        a, b, c = corners[faces[face, 0]], corners[faces[face, 1]], corners[faces[face, 2]]
        ux, uy, uz, vx, vy, vz = b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - a[0], c[1] - a[1], c[2] - a[2]
        if a[0] * (uy * vz - uz * vy) + a[1] * (uz * vx - ux * vz) + a[2] * (ux * vy - uy * vx) <= 0.0:
            continue  # its back is turned
        left, right, top, bottom = float(width), 0.0, float(view.end_row), float(view.first_row)
        for k in range(3):
            x, y, z = corners[faces[face, k], 0], corners[faces[face, k], 1], corners[faces[face, k], 2]
            if z < near:
                left, right, top, bottom = 0.0, float(width), float(view.first_row), float(view.end_row)
                break
            column, row = middle_x + focal_x * x / z, middle_y - focal_y * y / z
            left, right, top, bottom = min(left, column), max(right, column), min(top, row), max(bottom, row)
        first_row, end_row = int(max(top, float(view.first_row))), int(min(bottom + 1.0, float(view.end_row)))
        first_column, end_column = int(max(left, 0.0)), int(min(right + 1.0, float(width)))
        if first_row >= end_row or first_column >= end_column:
            continue
        for y in range(first_row - view.first_row, end_row - view.first_row):
            for pixel in range(np.uint64(y * width + first_column), np.uint64(y * width + end_column)):
                scratch.over_seen[pixel] = NOTHING
        visible(face, face + 1, False, faces, corners, pose.lens, view, scratch.inverse, scratch.over_seen)
        covered = np.int32(0)
        for y in range(first_row - view.first_row, end_row - view.first_row):
            for pixel in range(np.uint64(y * width + first_column), np.uint64(y * width + end_column)):
                covered += np.int32(scratch.over_seen[pixel] != NOTHING)
        if covered > 0:  # else something is before all of it
            window = (first_row, end_row, first_column, end_column)
            shade(window, scratch.over_seen, shapes, pose, scratch, view, picture)
