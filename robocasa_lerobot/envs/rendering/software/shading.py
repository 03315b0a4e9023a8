"""Colours of what is seen: OpenGL's lights at the corners of triangles, and textures in each pixel.

The formulas are those of OpenGL 1.5 (2.14 for light, with a local viewer, 3.8 for textures). What MuJoCo gives them was
found by comparing pictures: a material's colour counts for ambient and for diffuse light, its glow is `emission` times
its colour, its highlights are grey and as sharp as 128 times its `shininess`, and light is cut off at 1 before the
texture's colour is multiplied by it.
"""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.physics.native import compiled, inlined
from robocasa_lerobot.envs.rendering.software.arrays import (
    AMBIENT,
    ATTENUATION,
    DIFFUSE,
    DIRECTION,
    EXPONENT,
    IS_FAR,
    NARROWEST_COSINE,
    OPAQUE,
    POSITION,
    SPECULAR,
    Numbers,
    Picture,
    Pose,
    Scratch,
    Shapes,
    View,
)
from robocasa_lerobot.envs.rendering.software.textures import LANE_BITS, sampled

_SHARPEST = 128.0
_LANE = np.uint64(0xFFFF)
_TO_BYTES = 1.0 / 65280.0  # of 255 for the light times 255 and 8 bits of fraction for the texture


@inlined
def light(vertex: int, geom: int, shapes: Shapes, pose: Pose, scratch: Scratch) -> None:
    """Write the light that a vertex of a geom sends to the eye into `scratch.lit`."""
    turn, look, axes, eye = pose.rotations[geom], pose.looks[geom], pose.axes, pose.eye
    x, y, z = shapes.normals[vertex, 0], shapes.normals[vertex, 1], shapes.normals[vertex, 2]
    nx = turn[0] * x + turn[1] * y + turn[2] * z
    ny = turn[3] * x + turn[4] * y + turn[5] * z
    nz = turn[6] * x + turn[7] * y + turn[8] * z
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if length > 0.0:
        nx, ny, nz = nx / length, ny / length, nz / length
    right, up, forward = -scratch.corners[vertex, 0], -scratch.corners[vertex, 1], scratch.corners[vertex, 2]
    to_eye_x = axes[0] * right + axes[1] * up + axes[2] * forward
    to_eye_y = axes[3] * right + axes[4] * up + axes[5] * forward
    to_eye_z = axes[6] * right + axes[7] * up + axes[8] * forward
    x, y, z = eye[0] - to_eye_x, eye[1] - to_eye_y, eye[2] - to_eye_z
    length = np.sqrt(to_eye_x * to_eye_x + to_eye_y * to_eye_y + to_eye_z * to_eye_z)
    if length > 0.0:
        to_eye_x, to_eye_y, to_eye_z = to_eye_x / length, to_eye_y / length, to_eye_z / length
    red = green = blue = look[4]  # of the colour
    shine_red = shine_green = shine_blue = 0.0
    for one in pose.lights:
        lx, ly, lz, share = -one[DIRECTION], -one[DIRECTION + 1], -one[DIRECTION + 2], 1.0
        if one[IS_FAR] == 0.0:
            ax, ay, az = lx, ly, lz
            lx, ly, lz = one[POSITION] - x, one[POSITION + 1] - y, one[POSITION + 2] - z
            length = np.sqrt(lx * lx + ly * ly + lz * lz)
            if length > 0.0:
                lx, ly, lz = lx / length, ly / length, lz / length
            share = 1.0 / (one[ATTENUATION] + length * (one[ATTENUATION + 1] + length * one[ATTENUATION + 2]))
            along = lx * ax + ly * ay + lz * az
            if along < one[NARROWEST_COSINE]:
                continue
            if one[NARROWEST_COSINE] > -1.0:
                share *= max(along, 0.0) ** one[EXPONENT]
        red += share * one[AMBIENT]
        green += share * one[AMBIENT + 1]
        blue += share * one[AMBIENT + 2]
        facing = nx * lx + ny * ly + nz * lz
        if facing <= 0.0:
            continue
        red += share * facing * one[DIFFUSE]
        green += share * facing * one[DIFFUSE + 1]
        blue += share * facing * one[DIFFUSE + 2]
        hx, hy, hz = to_eye_x + lx, to_eye_y + ly, to_eye_z + lz
        length = np.sqrt(hx * hx + hy * hy + hz * hz)
        between = nx * hx + ny * hy + nz * hz
        if between > 0.0 and look[5] > 0.0:
            shine = share * look[5] * (between / length) ** (_SHARPEST * look[6])
            shine_red += shine * one[SPECULAR]
            shine_green += shine * one[SPECULAR + 1]
            shine_blue += shine * one[SPECULAR + 2]
    scratch.lit[vertex, 0] = min(1.0, red * look[0] + shine_red)
    scratch.lit[vertex, 1] = min(1.0, green * look[1] + shine_green)
    scratch.lit[vertex, 2] = min(1.0, blue * look[2] + shine_blue)


@inlined
def _put(picture: Picture, y: int, x: int, red: float, green: float, blue: float, opacity: float) -> None:
    """Lay a colour, each channel from 0 to 255, over a pixel."""
    if opacity < 1.0:
        rest = 1.0 - opacity
        red = red * opacity + picture[y, x, 0] * rest
        green = green * opacity + picture[y, x, 1] * rest
        blue = blue * opacity + picture[y, x, 2] * rest
    picture[y, x, 0] = np.uint8(red + 0.5)
    picture[y, x, 1] = np.uint8(green + 0.5)
    picture[y, x, 2] = np.uint8(blue + 0.5)


@compiled
def shade(
    window: tuple[int, int, int, int],
    seen: Numbers,
    shapes: Shapes,
    pose: Pose,
    scratch: Scratch,
    view: View,
    picture: Picture,
) -> None:
    """Colour each pixel in which a triangle is seen; what is not opaque lets through what the picture shows.

    Args:
        window: first and last row, first and last column and one more each.
        seen: as `scratch.seen`, of the rows of the view.
        shapes: of the model.
        pose: the state, as the camera sees it.
        scratch: with the corners of what is seen in the camera's frame.
        view: rows that are drawn.
        picture: changed, (height, width, 3).
    """
    focal_x, focal_y, middle_x, middle_y, _ = pose.lens
    faces, corners, texcoords = shapes.faces, scratch.corners, shapes.texcoords
    lit, is_lit, texels = scratch.lit, scratch.is_lit, shapes.texels
    for y in range(window[0], window[1]):
        up = (middle_y - y - 0.5) / focal_y
        row = (y - view.first_row) * view.width
        x = window[2]
        while x < window[3]:
            face = seen[row + x]
            end = x + 1
            while end < window[3] and seen[row + end] == face:
                end += 1
            if face < 0:
                x = end
                continue
            geom = shapes.geom_of[face]
            a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
            if not (is_lit[a] and is_lit[b] and is_lit[c]):
                for k in range(3):
                    vertex = faces[face, k]
                    if not is_lit[vertex]:
                        light(vertex, geom, shapes, pose, scratch)
                        is_lit[vertex] = True
            ax, ay, az = corners[a, 0], corners[a, 1], corners[a, 2]
            ux, uy, uz = corners[b, 0] - ax, corners[b, 1] - ay, corners[b, 2] - az
            vx, vy, vz = corners[c, 0] - ax, corners[c, 1] - ay, corners[c, 2] - az
            # Shares of b and c in a pixel are (P . ray) / (N . ray) and (Q . ray) / (N . ray), with ray = (x, y, 1).
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            px, py, pz = vy * az - vz * ay, vz * ax - vx * az, vx * ay - vy * ax
            qx, qy, qz = ay * uz - az * uy, az * ux - ax * uz, ax * uy - ay * ux
            nx, px, qx = nx / focal_x, px / focal_x, qx / focal_x
            # From the picture's edge on: a pixel's colour does not depend on which of its neighbours are seen.
            n, p, q = ny * up + nz - nx * middle_x, py * up + pz - px * middle_x, qy * up + qz - qx * middle_x
            across = x + 0.5
            red, green, blue = 255.0 * lit[a, 0], 255.0 * lit[a, 1], 255.0 * lit[a, 2]
            red_b, green_b, blue_b = 255.0 * lit[b, 0] - red, 255.0 * lit[b, 1] - green, 255.0 * lit[b, 2] - blue
            red_c, green_c, blue_c = 255.0 * lit[c, 0] - red, 255.0 * lit[c, 1] - green, 255.0 * lit[c, 2] - blue
            texture, opacity = shapes.texture_of[geom], pose.looks[geom, 3]
            if opacity >= OPAQUE:
                opacity = 1.0
            if texture < 0:
                for k in range(x, end):
                    share = 1.0 / (n + nx * across)
                    at_b, at_c = (p + px * across) * share, (q + qx * across) * share
                    one = red + at_b * red_b + at_c * red_c
                    two = green + at_b * green_b + at_c * green_c
                    three = blue + at_b * blue_b + at_c * blue_c
                    _put(picture, y, k, one, two, three, opacity)
                    across += 1.0
            else:
                copies, count = shapes.levels[texture], shapes.counts[texture]
                wide, high = float(copies[0, 1]), float(copies[0, 2])
                u, v = texcoords[a, 0], texcoords[a, 1]
                u_b, v_b = texcoords[b, 0] - u, texcoords[b, 1] - v
                u_c, v_c = texcoords[c, 0] - u, texcoords[c, 1] - v
                n_y, p_y, q_y = ny / focal_y, py / focal_y, qy / focal_y
                for k in range(x, end):
                    share = 1.0 / (n + nx * across)
                    at_b, at_c = (p + px * across) * share, (q + qx * across) * share
                    # How far the texture moves from pixel to pixel, in texels.
                    b_x, c_x = (px - at_b * nx) * share, (qx - at_c * nx) * share
                    b_y, c_y = (p_y - at_b * n_y) * share, (q_y - at_c * n_y) * share
                    u_x, v_x = (u_b * b_x + u_c * c_x) * wide, (v_b * b_x + v_c * c_x) * high
                    u_y, v_y = (u_b * b_y + u_c * c_y) * wide, (v_b * b_y + v_c * c_y) * high
                    spread = max(u_x * u_x + v_x * v_x, u_y * u_y + v_y * v_y)
                    at_u, at_v = u + at_b * u_b + at_c * u_c, v + at_b * v_b + at_c * v_c
                    texel = sampled(texels, copies, count, at_u, at_v, spread)
                    one = (red + at_b * red_b + at_c * red_c) * np.float64(np.int64(texel & _LANE))
                    texel = texel >> np.uint64(LANE_BITS)
                    two = (green + at_b * green_b + at_c * green_c) * np.float64(np.int64(texel & _LANE))
                    texel = texel >> np.uint64(LANE_BITS)
                    three = (blue + at_b * blue_b + at_c * blue_c) * np.float64(np.int64(texel & _LANE))
                    _put(picture, y, k, one * _TO_BYTES, two * _TO_BYTES, three * _TO_BYTES, opacity)
                    across += 1.0
            x = end
