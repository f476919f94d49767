"""The rasteriser: flat faces with textures, exactly occluded, one row of the picture after another.

A face is a parallelogram, with or without a hole, or an ellipse. Its points are o + u a + v b with
|u| <= 1 and |v| <= 1, or u^2 + v^2 <= 1. The ray through a pixel has the direction d, whose part
along the optical axis is 1, from the eye p. With w = o - p and n = a x b it meets the plane where

    1 / depth = n.d / n.w,    u / depth = (b x w).d / n.w,    v / depth = (w x a).d / n.w

(a homography: Hartley and Zisserman 2004, section 8.1.1). In one row of the picture d is linear in
the column, and so are these three numbers: a face covers the columns between the roots of linear
inequalities, and the largest 1 / depth of a pixel is what is seen. No face is clipped or sorted.

A picture is the mean of several passes. Each row of each pass has a pose of its own, so that a
shutter may stay open (motion blur) and may read one row after another (rolling shutter), and each
pass has an offset within the pixel, which smooths edges.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from quadsim.controllers.lanes import FAST
from quadsim.controllers.lanes.compiled import kept

# Kinds of faces
RECTANGLE = 0
ELLIPSE = 1
# Index of no face, which is the sky
NONE = -1
# [m] A face nearer than this is not drawn.
NEAR = 0.05
# Share by which a face must be nearer than another one: the first of two in one plane is seen.
TIE = 1e-6
# [px] Rows added to those between the projected corners of a face, as the pose changes by row
MARGIN = 3
# Columns that share a level of detail
COLUMNS = 16
# Numbers of single precision, so that a loop computes in it
ZERO = np.float32(0.0)
HALF = np.float32(0.5)
ONE = np.float32(1.0)
WHITE = np.float32(255.0)
STEPS = np.float32(255.0)
# texels of a texture's edge, and levels of detail of a texture, each half as fine as the one before
TEXELS = 128
LEVELS = 8


class Faces(NamedTuple):
    """All faces of a scene, as arrays of equal length."""

    # centre o, half axes a and b; a x b points out of the body [m]  (n, 3)
    origin: np.ndarray
    a: np.ndarray
    b: np.ndarray
    # RECTANGLE or ELLIPSE  (n,) int64
    kind: np.ndarray
    # half sizes of the hole in shares of a and b, 0: none  (n, 2)
    hole: np.ndarray
    # whether the face is seen from behind too  (n,) bool
    two_sided: np.ndarray
    # number in the segmentation  (n,) uint8
    ids: np.ndarray
    # index of the texture, which repeats, NONE: plain  (n,) int64
    texture: np.ndarray
    # half the number of repetitions along a and along b  (n, 2)
    repeats: np.ndarray
    # colour in the light of the scene, 0 to 1  (n, 3) float32
    tint: np.ndarray


class Film(NamedTuple):
    """Gain and noise of a camera's sensor, which convert light to the numbers of a picture."""

    # factor of all colours
    gain: float
    # standard deviation at 0, of numbers up to 255
    read: float
    # variance per unit of the number
    shot: float
    # standard normal numbers, which reach over the picture from `shift` on
    # (rows, columns, 3) float32
    grain: np.ndarray
    # row and column of `grain` at the picture's first pixel
    shift: tuple[int, int]


def pyramid(texture: np.ndarray) -> np.ndarray:
    """Return all levels of detail of a texture, one after another.

    Args:
        texture: (TEXELS, TEXELS, 3) uint8.

    Returns:
        (n,) int32: the texels of the first level row by row, then those of the next, each as red +
        256 green + 65536 blue.
    """
    level = texture.astype(np.float32)
    levels = []
    for _ in range(LEVELS):
        levels.append(level.reshape(-1, 3))
        if len(level) > 1:
            level = (level[::2, ::2] + level[1::2, ::2] + level[::2, 1::2] + level[1::2, 1::2]) / 4
    colours = np.rint(np.concatenate(levels)).astype(np.int32)
    return colours @ np.array([1, 256, 65536], np.int32)


@kept
@njit(fastmath=FAST, error_model="numpy", nogil=True)
def rows_of_faces(  # noqa: PLR0913 (the arrays of the faces one by one, for the compiler)
    eyes, axes, origin, a, b, two_sided, lens, shape, rows
):
    """Fill rows with the first row of each face and the row after its last.  (n, 2)

    A face that is turned away, behind the camera or beside the picture has no rows.

    Args:
        eyes: position of the camera by pass and row [m]  (passes, height, 3).
        axes: rotation world from camera by pass and row  (passes, height, 3, 3).
        origin, a, b, two_sided: as in Faces.
        lens: focal lengths and centre, fx, fy, cx, cy [px].
        shape: height and width of the picture [px].
        rows: the result.
    """
    fx, fy, cx, cy = lens
    height, width = shape
    for f in range(len(origin)):
        top = 1e9
        bottom = -1e9
        left = 1e9
        right = -1e9
        ahead = 0
        behind = 0
        turned = True
        for s in range(eyes.shape[0]):
            for part in range(3):
                row = part * (height - 1) // 2
                out = 0.0
                for i in range(3):
                    j = (i + 1) % 3
                    k = (i + 2) % 3
                    n = a[f, j] * b[f, k] - a[f, k] * b[f, j]
                    out += n * (eyes[s, row, i] - origin[f, i])
                turned &= out <= 0.0
                for corner in range(4):
                    su = 1.0 - 2.0 * (corner % 2)
                    sv = 1.0 - 2.0 * (corner // 2)
                    x = 0.0
                    y = 0.0
                    z = 0.0
                    for i in range(3):
                        away = origin[f, i] + su * a[f, i] + sv * b[f, i] - eyes[s, row, i]
                        x += axes[s, row, i, 0] * away
                        y += axes[s, row, i, 1] * away
                        z += axes[s, row, i, 2] * away
                    if z < NEAR:
                        behind += 1
                        continue
                    ahead += 1
                    left = min(left, fx * x / z + cx)
                    right = max(right, fx * x / z + cx)
                    top = min(top, fy * y / z + cy)
                    bottom = max(bottom, fy * y / z + cy)
        rows[f, 0] = 0
        rows[f, 1] = 0
        if ahead == 0 or (turned and not two_sided[f]):
            continue
        if behind:
            rows[f, 1] = height
        elif right > -MARGIN and left < width + MARGIN:
            rows[f, 0] = max(int(top) - MARGIN, 0)
            rows[f, 1] = max(min(int(bottom) + MARGIN + 1, height), rows[f, 0])


@kept
@njit(fastmath=FAST, error_model="numpy", nogil=True)
def draw(  # noqa: PLR0913, PLR0912, PLR0915, C901 (one loop nest, arrays one by one)
    eyes,
    axes,
    offsets,
    rows,
    origin,
    a,
    b,
    kind,
    hole,
    two_sided,
    texture,
    repeats,
    tint,
    textures,
    gradient,
    cover,
    cloud,
    lens,
    gain,
    read,
    shot,
    grain,
    shift_row,
    shift_column,
    rgb,
    inverse_depth,
    seen,
):
    """Draw a picture.

    Args:
        eyes, axes: pose of the camera by pass and row, as in `rows_of_faces`.
        offsets: offset of each pass within the pixel, to the right and down [px]  (passes, 2).
        rows: rows of each face, by `rows_of_faces`.
        origin to tint: as in Faces.
        textures: levels of detail of each texture, by `pyramid`  (textures, n).
        gradient, cover, cloud: as in quadsim.render.look.Sky.
        lens: focal lengths and centre, fx, fy, cx, cy [px].
        gain, read, shot, grain, shift_row, shift_column: as in Film.
        rgb: the picture  (height, width, 3) uint8.
        inverse_depth: of the first pass, along the optical axis [1/m]  (height, width) float32.
        seen: index of the face that the first pass sees, NONE: sky  (height, width) int16.
    """
    fx, fy, cx, cy = lens
    passes = eyes.shape[0]
    height = rgb.shape[0]
    width = rgb.shape[1]
    n = len(origin)
    nearest = np.empty(width)
    face = np.empty(width, np.int64)
    light = np.empty((3, width), np.float32)
    # u / depth and v / depth at column 0, and their change by column; factor of a texel's size
    at = np.empty((n, 5))
    middle = np.float32(cover.shape[0] - 1) / np.float32(2.0)
    factor = gain / np.float32(passes)
    lowest = 1.0 / 1e6
    for y in range(height):
        light[:] = 0.0
        for s in range(passes):
            # The direction of the ray through column 0, and its change by column.
            px = eyes[s, y, 0]
            py = eyes[s, y, 1]
            pz = eyes[s, y, 2]
            ahead_x = (0.5 + offsets[s, 0] - cx) / fx
            ahead_y = (y + 0.5 + offsets[s, 1] - cy) / fy
            R = axes[s, y]
            dx = R[0, 0] * ahead_x + R[0, 1] * ahead_y + R[0, 2]
            dy = R[1, 0] * ahead_x + R[1, 1] * ahead_y + R[1, 2]
            dz = R[2, 0] * ahead_x + R[2, 1] * ahead_y + R[2, 2]
            ex = R[0, 0] / fx
            ey = R[1, 0] / fx
            ez = R[2, 0] / fx

            # Which face is nearest in each column.
            nearest[:] = 0.0
            face[:] = NONE
            for f in range(n):
                if y < rows[f, 0] or y >= rows[f, 1]:
                    continue
                ax = a[f, 0]
                ay = a[f, 1]
                az = a[f, 2]
                bx = b[f, 0]
                by = b[f, 1]
                bz = b[f, 2]
                wx = origin[f, 0] - px
                wy = origin[f, 1] - py
                wz = origin[f, 2] - pz
                nx = ay * bz - az * by
                ny = az * bx - ax * bz
                nz = ax * by - ay * bx
                away = nx * wx + ny * wy + nz * wz
                if away == 0.0 or (away > 0.0 and not two_sided[f]):
                    continue
                # 1 / depth, u / depth and v / depth at column 0, and their change by column
                scale = 1.0 / away
                q0 = (nx * dx + ny * dy + nz * dz) * scale
                q1 = (nx * ex + ny * ey + nz * ez) * scale
                cross_x = by * wz - bz * wy
                cross_y = bz * wx - bx * wz
                cross_z = bx * wy - by * wx
                u0 = (cross_x * dx + cross_y * dy + cross_z * dz) * scale
                u1 = (cross_x * ex + cross_y * ey + cross_z * ez) * scale
                cross_x = wy * az - wz * ay
                cross_y = wz * ax - wx * az
                cross_z = wx * ay - wy * ax
                v0 = (cross_x * dx + cross_y * dy + cross_z * dz) * scale
                v1 = (cross_x * ex + cross_y * ey + cross_z * ez) * scale

                # The columns that it covers: where lowest <= q <= 1 / NEAR and, for a rectangle,
                # |u| <= q and |v| <= q. Each is k0 + k1 column >= 0.
                low = 0.0
                high = width - 1.0
                conditions = 6 if kind[f] == RECTANGLE else 2
                for c in range(conditions):
                    if c == 0:
                        k0, k1 = q0 - lowest, q1
                    elif c == 1:
                        k0, k1 = 1.0 / NEAR - q0, -q1
                    elif c == 2:
                        k0, k1 = q0 - u0, q1 - u1
                    elif c == 3:
                        k0, k1 = q0 + u0, q1 + u1
                    elif c == 4:
                        k0, k1 = q0 - v0, q1 - v1
                    else:
                        k0, k1 = q0 + v0, q1 + v1
                    if k1 > 0.0:
                        low = max(low, -k0 / k1)
                    elif k1 < 0.0:
                        high = min(high, -k0 / k1)
                    elif k0 < 0.0:
                        high = -1.0
                if kind[f] == ELLIPSE:
                    # q^2 - u^2 - v^2 >= 0, a parabola that opens downwards or misses the row
                    k2 = q1 * q1 - u1 * u1 - v1 * v1
                    k1 = 2.0 * (q0 * q1 - u0 * u1 - v0 * v1)
                    k0 = q0 * q0 - u0 * u0 - v0 * v0
                    inside = k1 * k1 - 4.0 * k2 * k0
                    if k2 >= 0.0 or inside < 0.0:
                        continue
                    root = np.sqrt(inside)
                    low = max(low, (k1 - root) / (-2.0 * k2))
                    high = min(high, (k1 + root) / (-2.0 * k2))
                if low > high:
                    continue
                first = int(np.ceil(low))
                end = int(np.floor(high)) + 1

                # The columns of its hole.
                hole_first = end
                hole_end = end
                hu = hole[f, 0]
                hv = hole[f, 1]
                if hu > 0.0:
                    for c in range(4):
                        if c == 0:
                            k0, k1 = hu * q0 - u0, hu * q1 - u1
                        elif c == 1:
                            k0, k1 = hu * q0 + u0, hu * q1 + u1
                        elif c == 2:
                            k0, k1 = hv * q0 - v0, hv * q1 - v1
                        else:
                            k0, k1 = hv * q0 + v0, hv * q1 + v1
                        if k1 > 0.0:
                            low = max(low, -k0 / k1)
                        elif k1 < 0.0:
                            high = min(high, -k0 / k1)
                        elif k0 < 0.0:
                            high = -1.0
                    if low <= high:
                        hole_first = max(int(np.ceil(low)), first)
                        hole_end = min(int(np.floor(high)) + 1, end)

                # A texel's size in pixels follows from the depth and the slant of the face.
                at[f, 0] = u0
                at[f, 1] = u1
                at[f, 2] = v0
                at[f, 3] = v1
                edge = np.sqrt(repeats[f, 0] * repeats[f, 1] / np.sqrt(nx * nx + ny * ny + nz * nz))
                normal = np.sqrt(nx * nx + ny * ny + nz * nz)
                at[f, 4] = TEXELS * edge * normal / (fx * abs(away))
                for x in range(first, hole_first):
                    q = q0 + q1 * x
                    if q * (1.0 - TIE) > nearest[x]:
                        nearest[x] = q
                        face[x] = f
                for x in range(hole_end, end):
                    q = q0 + q1 * x
                    if q * (1.0 - TIE) > nearest[x]:
                        nearest[x] = q
                        face[x] = f

            # Colours, by runs of columns that see the same face.
            end = 0
            while end < width:
                first = end
                f = face[first]
                while end < width and face[end] == f:
                    end += 1
                if f == NONE and cover.shape[0] > 1:
                    for x in range(first, end):
                        gx = np.float32(dx + x * ex)
                        gy = np.float32(dy + x * ey)
                        gz = np.float32(dz + x * ez)
                        long = ONE / np.sqrt(gx * gx + gy * gy + gz * gz)
                        up = min(max(gz * long, ZERO), ONE)
                        k = np.int32(np.sqrt(up) * STEPS)
                        half = middle / (ONE + up) * long
                        row = np.int32(middle + half * gx)
                        column = np.int32(middle + half * gy)
                        cloudy = cover[row, column]
                        for c in range(3):
                            clear = gradient[k, c]
                            light[c, x] += clear + cloudy * (cloud[c] - clear)
                elif f == NONE:
                    for x in range(first, end):
                        gx = np.float32(dx + x * ex)
                        gy = np.float32(dy + x * ey)
                        gz = np.float32(dz + x * ez)
                        up = min(max(gz / np.sqrt(gx * gx + gy * gy + gz * gz), ZERO), ONE)
                        k = np.int32(np.sqrt(up) * STEPS)
                        for c in range(3):
                            light[c, x] += gradient[k, c]
                elif texture[f] == NONE:
                    for c in range(3):
                        plain = WHITE * tint[f, c]
                        for x in range(first, end):
                            light[c, x] += plain
                else:
                    # The level of detail is that of the middle of some columns.
                    u0 = at[f, 0] * repeats[f, 0]
                    u1 = at[f, 1] * repeats[f, 0]
                    v0 = at[f, 2] * repeats[f, 1]
                    v1 = at[f, 3] * repeats[f, 1]
                    red = tint[f, 0]
                    green = tint[f, 1]
                    blue = tint[f, 2]
                    texels = textures[texture[f]]
                    for some in range(first, end, COLUMNS):
                        stop = min(some + COLUMNS, end)
                        depth = 1.0 / nearest[(some + stop) // 2]
                        size = at[f, 4] * depth * depth
                        level = 0
                        edge = TEXELS
                        begin = 0
                        while size > 1.4 and level < LEVELS - 1:
                            size *= 0.5
                            level += 1
                            begin += edge * edge
                            edge //= 2
                        mask = np.int32(edge - 1)
                        wide = np.int32(edge)
                        offset = np.int32(begin)
                        for x in range(some, stop):
                            depth = edge / nearest[x]
                            column = np.int32(np.floor((u0 + u1 * x) * depth)) & mask
                            row = np.int32(np.floor((v0 + v1 * x) * depth)) & mask
                            texel = texels[offset + row * wide + column]
                            light[0, x] += red * np.float32(texel & 255)
                            light[1, x] += green * np.float32((texel >> 8) & 255)
                            light[2, x] += blue * np.float32(texel >> 16)

            if s == 0:
                for x in range(width):
                    inverse_depth[y, x] = nearest[x]
                    seen[y, x] = face[x]

        # The numbers of the picture.
        for c in range(3):
            if read > ZERO or shot > ZERO:
                for x in range(width):
                    number = light[c, x] * factor
                    spread = np.sqrt(read * read + shot * max(number, ZERO))
                    number += spread * grain[y + shift_row, x + shift_column, c]
                    rgb[y, x, c] = np.uint8(min(max(number + HALF, ZERO), WHITE))
            else:
                for x in range(width):
                    number = light[c, x] * factor + HALF
                    rgb[y, x, c] = np.uint8(min(max(number, ZERO), WHITE))
