"""The rasteriser, which draws flat faces with textures and exact occlusion, row by row.

A face is a parallelogram, with or without a hole, or an ellipse. Its points are o + u a + v b with
|u| <= 1 and |v| <= 1, or u^2 + v^2 <= 1. The ray through a pixel starts at the eye p and has the
direction d, whose component along the optical axis is 1. With w = o - p and n = a x b it meets the
plane where

    1 / depth = n.d / n.w,    u / depth = (b x w).d / n.w,    v / depth = (w x a).d / n.w

(a homography: Hartley and Zisserman 2004, section 8.1.1). In one row of the picture d is linear in
the column, and so are these three numbers: a face covers the columns between the roots of linear
inequalities, and a pixel shows the face with the largest 1 / depth. No face is clipped or sorted.

A picture is the mean of several passes. Each row of each pass has its own pose, so that a shutter
may stay open (motion blur) and may read one row after another (rolling shutter). Each pass has an
offset within the pixel, which smooths edges.

The loops over columns are written so that the compiler can vectorise them: single precision, no
branches, loads from tables separate from arithmetic, and unsigned indices, because numba tests
whether a signed index is negative.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from quadsim.controllers.lanes import FAST
from quadsim.controllers.lanes.compiled import inner, kept

# Kinds of faces
RECTANGLE = 0
ELLIPSE = 1
# Index of no face, which is the sky
NONE = -1
# [m] A face nearer than this is not drawn.
NEAR = 0.05
# [m] Nor is a face farther than this.
FAR = 1e6
# Factor of 1 / depth of a face that is compared with others: the first of two in one plane is seen.
NEARER = np.float32(1.0 - 1e-6)
# [px] Rows added around the projected corners of a face, because the pose changes by row
MARGIN = 3
# A column to begin with: numba compiles functions twice for a variable that begins as a literal.
START = np.int64(0)
# Columns that are compared at once, and that share a level of detail
COLUMNS = 16
# Largest size of a texel of the level of detail that is used, in 1 / px
FINEST = 1.4
# Numbers of single precision, so that a loop computes in it
ZERO = np.float32(0.0)
HALF = np.float32(0.5)
ONE = np.float32(1.0)
WHITE = np.float32(255.0)
# Parts of a pixel in the weights of `bend`, and the bits of its square
WHOLE = np.int32(256)
SHIFT = np.int32(16)
# texels of a texture's edge, and levels of detail of a texture, each half as fine as the one before
TEXELS = 128
LEVELS = 8


class Faces(NamedTuple):
    """All faces of a scene, as arrays of equal length."""

    # centre o, half axes a and b; a x b points out of the body [m]  (n, 3)
    origin: np.ndarray
    a: np.ndarray
    b: np.ndarray
    # a x b [m^2]  (n, 3)
    normal: np.ndarray
    # RECTANGLE or ELLIPSE  (n,) int64
    kind: np.ndarray
    # half sizes of the hole in shares of a and b, 0: no hole  (n, 2)
    hole: np.ndarray
    # whether the face is seen from behind too  (n,) bool
    two_sided: np.ndarray
    # number in the segmentation  (n,) uint8
    ids: np.ndarray
    # index of the texture, which repeats, NONE: plain  (n,) int64
    texture: np.ndarray
    # half the number of repetitions along a and along b  (n, 2)
    repeats: np.ndarray
    # texels of its finest level in a metre, times |a x b| [m]  (n,)
    texels: np.ndarray
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
    # (3, rows, columns) float32
    grain: np.ndarray
    # row and column of `grain` at the picture's first pixel
    shift: tuple[int, int]


class Drawn(NamedTuple):
    """The arrays that `draw` fills."""

    # red, green and blue of each pixel in turn  (height, 3 width) uint8
    rgb: np.ndarray
    # of the first pass, along the optical axis [1/m]  (height, width) float32
    inverse_depth: np.ndarray
    # index of the face that the first pass sees, NONE: sky  (height, width) int16
    seen: np.ndarray


class WorkSpace(NamedTuple):
    """The work space of one row of the picture."""

    # the columns, 0, 1, 2 and so on  (width,) float32
    ramp: np.ndarray
    # 1 / depth and index of the nearest face so far  (width,) float32, int32
    nearest: np.ndarray
    face: np.ndarray
    # sums of the colours of all passes, and number of passes that see the sky  (width,) float32
    red: np.ndarray
    green: np.ndarray
    blue: np.ndarray
    clear: np.ndarray
    # place in a texture, and the texel there  (width,) uint32, uint32, int32
    line: np.ndarray
    place: np.ndarray
    texel: np.ndarray
    # square root of the sine of the elevation, and cover of the sky  (width,) float32
    height: np.ndarray
    cover: np.ndarray
    # the numbers of the picture  (3, width) uint8
    numbers: np.ndarray
    # indices of the faces that reach into the row, and the numbers of `_line` of each face, with
    # its texels in a pixel at depth 1, times fx  (n,) int64, (n, 7)
    active: np.ndarray
    lines: np.ndarray


def work_space(width: int, faces: int) -> WorkSpace:
    """Return the arrays in which a row is drawn.

    Args:
        width: number of columns of the picture.
        faces: number of faces of the scene.
    """
    return WorkSpace(
        ramp=np.arange(width, dtype=np.float32),
        nearest=np.empty(width, np.float32),
        face=np.empty(width, np.int32),
        red=np.empty(width, np.float32),
        green=np.empty(width, np.float32),
        blue=np.empty(width, np.float32),
        clear=np.empty(width, np.float32),
        line=np.empty(width, np.uint32),
        place=np.empty(width, np.uint32),
        texel=np.empty(width, np.int32),
        height=np.empty(width, np.float32),
        cover=np.empty(width, np.float32),
        numbers=np.empty((3, width), np.uint8),
        active=np.empty(faces, np.int64),
        lines=np.empty((faces, 7)),
    )


def pyramid(texture: np.ndarray) -> np.ndarray:
    """Return all levels of detail of a texture, one after another.

    Args:
        texture: the texture  (TEXELS, TEXELS, 3) uint8.

    Returns:
        The texels of the first level row by row, then the texels of the next level and so on, each
        as red + 256 green + 65536 blue  (n,) int32.
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
def rows_of_faces(eyes, axes, faces, lens, shape, rows):
    """Fill `rows` with the first row of each face and the row after its last row.  (n, 2)

    A face that is turned away, behind the camera or beside the picture has no rows.

    Args:
        eyes: position of the camera for each pass and row [m]  (passes, height, 3).
        axes: rotation from camera to world axes for each pass and row  (passes, height, 3, 3).
        faces: Faces.
        lens: focal lengths and centre, fx, fy, cx, cy [px].
        shape: height and width of the picture [px].
        rows: array for the result  (n, 2).
    """
    fx, fy, cx, cy = lens
    height, width = shape
    origin, a, b = faces.origin, faces.a, faces.b
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
                    out += faces.normal[f, i] * (eyes[s, row, i] - origin[f, i])
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
        if ahead == 0 or (turned and not faces.two_sided[f]):
            continue
        if behind:
            rows[f, 1] = height
        elif right > -MARGIN and left < width + MARGIN:
            rows[f, 0] = max(int(top) - MARGIN, 0)
            rows[f, 1] = max(min(int(bottom) + MARGIN + 1, height), rows[f, 0])


@inner
def _ray(axes, offset, lens, y):
    """Return the direction of the ray through column 0 of a row, and its change per column."""
    fx, fy, cx, cy = lens
    right = (0.5 + offset[0] - cx) / fx
    down = (y + 0.5 + offset[1] - cy) / fy
    dx = axes[0, 0] * right + axes[0, 1] * down + axes[0, 2]
    dy = axes[1, 0] * right + axes[1, 1] * down + axes[1, 2]
    dz = axes[2, 0] * right + axes[2, 1] * down + axes[2, 2]
    return dx, dy, dz, axes[0, 0] / fx, axes[1, 0] / fx, axes[2, 0] / fx


@inner
def _line(n, a, b, w, away, ray):
    """Return 1 / depth, u / depth and v / depth at column 0, each with its change per column.

    Args:
        n: normal of the face, a x b.
        a, b: half axes of the face.
        w: vector from the eye to the face's centre.
        away: the product n.w.
        ray: result of `_ray`.
    """
    nx, ny, nz = n
    ax, ay, az = a
    bx, by, bz = b
    wx, wy, wz = w
    dx, dy, dz, ex, ey, ez = ray
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
    return q0, q1, u0, u1, v0, v1


@inner
def _where_positive(k0, k1, low, high):
    """Return the range of columns, within `low` to `high`, in which k0 + k1 column >= 0."""
    root = -k0 / k1
    if k1 > 0.0:
        return max(low, root), high
    if k1 < 0.0:
        return low, min(high, root)
    return low, (high if k0 >= 0.0 else -1.0)


@inner
def _in_rectangle(line, half_u, half_v, low, high):
    """Return the range of columns in which |u| <= half_u and |v| <= half_v."""
    q0, q1, u0, u1, v0, v1 = line
    low, high = _where_positive(half_u * q0 - u0, half_u * q1 - u1, low, high)
    low, high = _where_positive(half_u * q0 + u0, half_u * q1 + u1, low, high)
    low, high = _where_positive(half_v * q0 - v0, half_v * q1 - v1, low, high)
    return _where_positive(half_v * q0 + v0, half_v * q1 + v1, low, high)


@inner
def _in_ellipse(line, low, high):
    """Return the range of columns in which u^2 + v^2 <= 1."""
    # q^2 - u^2 - v^2 >= 0, a parabola that opens downwards or misses the row
    q0, q1, u0, u1, v0, v1 = line
    k2 = q1 * q1 - u1 * u1 - v1 * v1
    k1 = 2.0 * (q0 * q1 - u0 * u1 - v0 * v1)
    k0 = q0 * q0 - u0 * u0 - v0 * v0
    inside = k1 * k1 - 4.0 * k2 * k0
    if k2 >= 0.0 or inside < 0.0:
        return low, -1.0
    root = np.sqrt(inside)
    return max(low, (k1 - root) / (-2.0 * k2)), min(high, (k1 + root) / (-2.0 * k2))


@inner
def _enter(f, q0, q1, first, end, ramp, nearest, face):
    """Enter a face in those columns from `first` to `end` in which it is nearest so far."""
    q_first = np.float32(q0 + q1 * first)
    change = np.float32(q1)
    number = np.int32(f)
    x = np.uint64(first)
    for i in range(np.uint64(max(end - first, 0))):
        q = q_first + change * ramp[i]
        nearer = q * NEARER > nearest[x + i]
        nearest[x + i] = q if nearer else nearest[x + i]
        face[x + i] = number if nearer else face[x + i]


@inner
def _enter_all(  # noqa: PLR0913
    active, count, faces, eye, ray, ramp, nearest, face, lines
):
    """Find the nearest face in each column of one pass.

    Args:
        active: indices of the faces that reach into this row.
        faces: Faces.
        eye: position of the camera [m]  (3,).
        ray: result of `_ray`.
        ramp: the numbers of the columns, 0, 1, 2 and so on  (width,) float32.
        nearest, face: arrays for 1 / depth [1/m] and the index of the nearest face  (width,).
        lines: array for the six numbers of `_line` of each entered face, and the number of texels
            in a pixel at depth 1, times fx  (n, 7).
    """
    for x in range(len(face)):
        nearest[x] = ZERO
        face[x] = NONE
    last = len(face) - 1.0
    for index in range(count):
        f = active[index]
        wx = faces.origin[f, 0] - eye[0]
        wy = faces.origin[f, 1] - eye[1]
        wz = faces.origin[f, 2] - eye[2]
        n = (faces.normal[f, 0], faces.normal[f, 1], faces.normal[f, 2])
        away = n[0] * wx + n[1] * wy + n[2] * wz
        if away == 0.0 or (away > 0.0 and not faces.two_sided[f]):
            continue
        a = (faces.a[f, 0], faces.a[f, 1], faces.a[f, 2])
        b = (faces.b[f, 0], faces.b[f, 1], faces.b[f, 2])
        line = _line(n, a, b, (wx, wy, wz), away, ray)
        q0, q1 = line[0], line[1]

        # The columns that it covers, at depths from NEAR to FAR.
        low, high = _where_positive(q0 - 1.0 / FAR, q1, 0.0, last)
        low, high = _where_positive(1.0 / NEAR - q0, -q1, low, high)
        if faces.kind[f] == ELLIPSE:
            low, high = _in_ellipse(line, low, high)
        else:
            low, high = _in_rectangle(line, 1.0, 1.0, low, high)
        if low > high:
            continue
        for k in range(6):
            lines[f, k] = line[k]
        lines[f, 6] = faces.texels[f] / abs(away)
        first = int(np.ceil(low))
        end = int(np.floor(high)) + 1
        # What is right of its hole, and the rest, left of the hole.
        if faces.hole[f, 0] > 0.0:
            low, high = _in_rectangle(line, faces.hole[f, 0], faces.hole[f, 1], low, high)
            if low <= high:
                _enter(f, q0, q1, max(int(np.floor(high)) + 1, first), end, ramp, nearest, face)
                end = min(int(np.ceil(low)), end)
        _enter(f, q0, q1, first, end, ramp, nearest, face)


@inner
def _end_of_run(face, first):
    """Return the column after the run of columns that see the same face as column `first`."""
    f = face[first]
    end = first
    while end + COLUMNS <= len(face):
        others = 0
        x = np.uint64(end)
        for i in range(np.uint64(COLUMNS)):
            others += face[x + i] != f
        if others:
            break
        end += COLUMNS
    while end < len(face) and face[end] == f:
        end += 1
    return end


@inner
def _level(size):
    """Return the first texel and the edge length of the level of detail for a size [texels/px]."""
    begin = 0
    edge = TEXELS
    while size > FINEST and edge > 1:
        size *= 0.5
        begin += edge * edge
        edge //= 2
    return begin, edge


@inner
def _add_texture(  # noqa: PLR0913
    line, repeats, fx, texels, tint, first, end, ramp, nearest, place, texel, red, green, blue
):
    """Add a texture to the columns from `first` to `end`.

    Args:
        line: a row of `lines`, as in `_enter_all`.
        repeats: half the number of repetitions along both axes  (2,).
        fx: focal length [px].
        texels: result of `pyramid`.
        tint: factor of the colours  (3,).
        first, end: columns.
        ramp, nearest: as in `_enter_all`.
        place, texel: work space  (width,) uint32, int32.
        red, green, blue: sums of light  (width,).
    """
    u0, u1 = repeats[0] * line[2], repeats[0] * line[3]
    v0, v1 = repeats[1] * line[4], repeats[1] * line[5]
    size = line[6] / fx
    r, g, b = tint[0], tint[1], tint[2]
    # As 1 / depth is linear in the column, all columns have the level of detail that both ends
    # have. If these differ, COLUMNS share the level of their middle.
    _, left = _level(size / nearest[first] ** 2)
    _, right = _level(size / nearest[end - 1] ** 2)
    together = end - first if left == right else COLUMNS
    for some in range(first, end, together):
        stop = min(some + together, end)
        begin, edge = _level(size / nearest[(some + stop) // 2] ** 2)
        scale = np.float32(edge)
        wide = np.int32(edge)
        inside = np.int32(edge - 1)
        offset = np.int32(begin)
        u_first, u_change = np.float32(u0 + u1 * some), np.float32(u1)
        v_first, v_change = np.float32(v0 + v1 * some), np.float32(v1)
        x = np.uint64(some)
        count = np.uint64(stop - some)
        for i in range(count):
            depth = scale / nearest[x + i]
            u = np.int32(np.floor((u_first + u_change * ramp[i]) * depth)) & inside
            v = np.int32(np.floor((v_first + v_change * ramp[i]) * depth)) & inside
            place[i] = np.uint32(offset + v * wide + u)
        for i in range(count):
            texel[i] = texels[place[i]]
        for i in range(count):
            red[x + i] += r * np.float32(texel[i] & 255)
            green[x + i] += g * np.float32((texel[i] >> 8) & 255)
            blue[x + i] += b * np.float32(texel[i] >> 16)


@inner
def _add_plain(values, first, end, number):
    """Add a number to the columns from `first` to `end`."""
    for x in range(np.uint64(first), np.uint64(end)):
        values[x] += number


@inner
def _add_sky(  # noqa: PLR0913
    ray, sky, first, end, ramp, clear, height, cover, line, column, red, green, blue
):
    """Add the sky's light to the columns from `first` to `end`, once for each pass that sees it.

    Args:
        ray: result of `_mean_ray`.
        sky: quadsim.render.look.Sky.
        first, end: columns.
        ramp: as in `_enter_all`.
        clear: number of passes that see the sky  (width,) float32.
        height, cover, line, column: work space  (width,) float32 and uint32.
        red, green, blue: sums of light  (width,).
    """
    dx, dy, dz, ex, ey, ez = ray
    x_first, x_change = np.float32(dx + ex * first), np.float32(ex)
    y_first, y_change = np.float32(dy + ey * first), np.float32(ey)
    z_first, z_change = np.float32(dz + ez * first), np.float32(ez)
    middle = np.float32(sky.cover.shape[0] - 1) * HALF
    begin = np.uint64(first)
    count = np.uint64(end - first)
    for i in range(count):
        x = x_first + x_change * ramp[i]
        y = y_first + y_change * ramp[i]
        z = z_first + z_change * ramp[i]
        unit = ONE / np.sqrt(x * x + y * y + z * z)
        up = min(max(z * unit, ZERO), ONE)
        height[i] = np.sqrt(up)
        half = middle / (ONE + up) * unit
        line[i] = np.uint32(np.int32(middle + half * x))
        column[i] = np.uint32(np.int32(middle + half * y))
    for i in range(count):
        cover[i] = sky.cover[line[i], column[i]]
    for c, light in ((0, red), (1, green), (2, blue)):
        horizon, cloud = sky.horizon[c], sky.cloud[c]
        rise = sky.zenith[c] - horizon
        for i in range(count):
            colour = horizon + height[i] * rise
            light[begin + i] += clear[begin + i] * (colour + cover[i] * (cloud - colour))


@inner
def _develop(light, factor, read, shot, grain, numbers):
    """Convert the light of one colour in a row to pixel values up to 255, with noise."""
    if read > ZERO or shot > ZERO:
        for x in range(len(light)):
            number = light[x] * factor
            number += np.sqrt(read * read + shot * max(number, ZERO)) * grain[x]
            numbers[x] = np.uint8(np.int32(min(max(number + HALF, ZERO), WHITE)))
    else:
        for x in range(len(light)):
            numbers[x] = np.uint8(np.int32(min(max(light[x] * factor + HALF, ZERO), WHITE)))


@inner
def _interleave(red, green, blue, pixels):
    """Write the three colour values of each pixel one after another."""
    for x in range(len(red)):
        pixels[3 * x] = red[x]
        pixels[3 * x + 1] = green[x]
        pixels[3 * x + 2] = blue[x]


@inner
def _see(f, line, first, end, inverse_depth, seen):
    """Write the face that is seen by the columns from `first` to `end`, and its 1 / depth."""
    q0, q1 = line[0], line[1]
    number = np.int16(f)
    for x in range(np.uint64(first), np.uint64(end)):
        inverse_depth[x] = np.float32(q0 + q1 * np.float64(x)) if number != NONE else ZERO
        seen[x] = number


@inner
def _mean_ray(axes, offsets, lens, y):
    """Return the sum of `_ray` over all passes, which has their mean direction."""
    sx, sy, sz, tx, ty, tz = _ray(axes[0, y], offsets[0], lens, y)
    for s in range(1, len(axes)):
        dx, dy, dz, ex, ey, ez = _ray(axes[s, y], offsets[s], lens, y)
        sx, sy, sz = sx + dx, sy + dy, sz + dz
        tx, ty, tz = tx + ex, ty + ey, tz + ez
    return sx, sy, sz, tx, ty, tz


@inner
def _reaching(rows, y, active):
    """Write the indices of the faces that reach into row y, and return their number."""
    count = START
    for f in range(len(rows)):
        if rows[f, 0] <= y < rows[f, 1]:
            active[count] = f
            count += 1
    return count


@kept
@njit(fastmath=FAST, error_model="numpy", nogil=True)
def draw(  # noqa: PLR0913
    eyes, axes, offsets, rows, faces, textures, sky, lens, film, row, drawn
):
    """Draw a picture.

    Args:
        eyes, axes: pose of the camera for each pass and row, as in `rows_of_faces`.
        offsets: offset of each pass within the pixel, to the right and down [px]  (passes, 2).
        rows: rows of each face, from `rows_of_faces`.
        faces: Faces.
        textures: levels of detail of each texture, from `pyramid`  (textures, n).
        sky: quadsim.render.look.Sky.
        lens: focal lengths and centre, fx, fy, cx, cy [px].
        film: Film.
        row: WorkSpace.
        drawn: Drawn, which is filled.
    """
    # The arrays of the innermost loops are passed one by one, because numba counts references to
    # arrays in a record.
    ramp, nearest, face, lines = row.ramp, row.nearest, row.face, row.lines
    red, green, blue, clear = row.red, row.green, row.blue, row.clear
    line, place, texel = row.line, row.place, row.texel
    height, cover, numbers = row.height, row.cover, row.numbers
    width = len(face)
    factor = np.float32(film.gain / len(eyes))
    read = np.float32(film.read)
    shot = np.float32(film.shot)
    noisy = read > ZERO or shot > ZERO
    top, left = film.shift
    for y in range(len(drawn.rgb)):
        count = _reaching(rows, y, row.active)
        for x in range(width):
            red[x] = ZERO
            green[x] = ZERO
            blue[x] = ZERO
            clear[x] = ZERO
        sky_first = width
        sky_end = START
        for s in range(len(eyes)):
            ray = _ray(axes[s, y], offsets[s], lens, y)
            _enter_all(row.active, count, faces, eyes[s, y], ray, ramp, nearest, face, lines)

            # Colours, by runs of columns that see the same face.
            end = START
            while end < width:
                first = end
                end = _end_of_run(face, first)
                f = face[first]
                if f == NONE:
                    sky_first = min(sky_first, first)
                    sky_end = max(sky_end, end)
                    _add_plain(clear, first, end, ONE)
                elif faces.texture[f] == NONE:
                    _add_plain(red, first, end, WHITE * faces.tint[f, 0])
                    _add_plain(green, first, end, WHITE * faces.tint[f, 1])
                    _add_plain(blue, first, end, WHITE * faces.tint[f, 2])
                else:
                    # fmt: off
                    _add_texture(
                        lines[f], faces.repeats[f], lens[0], textures[faces.texture[f]],
                        faces.tint[f], first, end, ramp, nearest, place, texel, red, green, blue,
                    )
                    # fmt: on
                if s == 0:
                    _see(f, lines[f], first, end, drawn.inverse_depth[y], drawn.seen[y])

        # The sky is smooth and infinitely far: all passes share the colour of their mean direction.
        if sky_first < sky_end:
            # fmt: off
            _add_sky(
                _mean_ray(axes, offsets, lens, y), sky, sky_first, sky_end, ramp, clear,
                height, cover, line, place, red, green, blue,
            )
            # fmt: on

        for c, light in ((0, red), (1, green), (2, blue)):
            grain = film.grain[c, y + top if noisy else 0, left:]
            _develop(light, factor, read, shot, grain, numbers[c])
        _interleave(numbers[0], numbers[1], numbers[2], drawn.rgb[y])


@kept
@njit(fastmath=FAST, error_model="numpy", nogil=True)
def bend(rgb, corner, right, down, bent):
    """Resample a picture by bilinear interpolation between four pixels.

    Args:
        rgb: the picture, red, green and blue of each pixel in turn  (height, 3 width) uint8.
        corner: for each pixel of the result, index of the source pixel to the upper left of the
            sampled point, row by row  (n,) int32.
        right, down: offset from there to the sampled point [px / WHOLE]  (n,) int16.
        bent: the result, red, green and blue of each pixel in turn  (3 n,) uint8.
    """
    flat = rgb.reshape(-1)
    after = np.uint64(3)
    below = np.uint64(rgb.shape[1])
    both = below + after
    rounding = np.int32(WHOLE * WHOLE // 2)
    for i in range(len(corner)):
        at = np.uint64(3 * corner[i])
        to = np.uint64(3 * i)
        r, d = np.int32(right[i]), np.int32(down[i])
        left, up = WHOLE - r, WHOLE - d
        for c in (np.uint64(0), np.uint64(1), np.uint64(2)):
            upper = left * np.int32(flat[at + c]) + r * np.int32(flat[at + c + after])
            lower = left * np.int32(flat[at + c + below]) + r * np.int32(flat[at + c + both])
            bent[to + c] = np.uint8((up * upper + d * lower + rounding) >> SHIFT)
