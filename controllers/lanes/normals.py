"""Counter-based standard normals: Philox-4x32-10 (Salmon et al. 2011) and Box-Muller, in lanes.

Each number is a function only of the key, the call and the place in the array. Results therefore
do not depend on the number of threads, and any sample can be recomputed without earlier ones.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import extending, njit, types

from quadsim.controllers.lanes import FAST
from quadsim.controllers.lanes.compiled import kept
from quadsim.controllers.lanes.sharing import on_threads, share

F = np.float32
I4 = np.int32
U4 = np.uint32
U8 = np.uint64
inline = njit(fastmath=FAST, error_model="numpy", inline="always")


@extending.intrinsic
def _bits(typing_context, x):
    """Return the 32 bits of a float32 as an int32."""
    return types.int32(types.float32), lambda context, builder, signature, a: builder.bitcast(
        a[0], ir.IntType(32)
    )


@extending.intrinsic
def _float(typing_context, x):
    """Return the float32 of 32 bits."""
    return types.float32(types.int32), lambda context, builder, signature, a: builder.bitcast(
        a[0], ir.FloatType()
    )


@njit(inline="always")
def philox(c0, c1, c2, c3, k0, k1):
    """Return four uint32: ten rounds of Philox on the counter c0..c3 with the key k0, k1."""
    for _ in range(10):
        p0 = U8(0xD2511F53) * U8(c0)
        p1 = U8(0xCD9E8D57) * U8(c2)
        c0, c1, c2, c3 = (
            U4(U4(p1 >> U8(32)) ^ c1 ^ k0),
            U4(p1),
            U4(U4(p0 >> U8(32)) ^ c3 ^ k1),
            U4(p0),
        )
        k0 = U4(k0 + U4(0x9E3779B9))
        k1 = U4(k1 + U4(0xBB67AE85))
    return c0, c1, c2, c3


@inline
def log_unit(x) -> Any:
    """Return ln x for float32 0 < x <= 1.

    It is the sum of the exponent's part and atanh's series for the mantissa in [1/sqrt 2, sqrt 2).
    """
    # numba takes int32 - int32 to 64 bits, of which a vector holds half as many.
    bits = I4(_bits(x) - I4(0x3F3504F3))  # pyright: ignore[reportCallIssue]
    exponent = F(I4(bits >> I4(23)))
    m = _float(I4((bits & I4(0x007FFFFF)) + I4(0x3F3504F3)))  # pyright: ignore[reportCallIssue]
    s = (m - F(1)) / (m + F(1))  # ln m = 2 (s + s^3/3 + s^5/5 + ...), |s| < .172
    s2 = s * s
    series = F(2) + s2 * (F(2 / 3) + s2 * (F(2 / 5) + s2 * (F(2 / 7) + s2 * F(2 / 9))))
    return s * series + exponent * F(math.log(2))


@inline
def sin_cos_turn(u):
    """Return sin and cos of 2 pi u / 2^32.

    They are computed by Taylor series at half of the angle and the double-angle formulas.
    """
    x = F(I4(u)) * F(math.pi / 2**32)  # half the angle, in [-pi/2, pi/2)
    x2 = x * x
    s = x * (F(1) + x2 * (F(-1 / 6) + x2 * (F(1 / 120) + x2 * (F(-1 / 5040) + x2 * F(1 / 362880)))))
    c = F(1) + x2 * (
        F(-1 / 2)
        + x2 * (F(1 / 24) + x2 * (F(-1 / 720) + x2 * (F(1 / 40320) - x2 * F(1 / 3628800))))
    )
    return F(2) * s * c, c * c - s * s


@inline
def box_muller(a, b) -> tuple[Any, Any]:
    """Return two independent standard normals from two uint32, with a radius of at most 5.9."""
    r = math.sqrt(F(-2) * log_unit(F(I4(a >> U4(8))) * F(2.0**-24) + F(2.0**-25)))
    s, c = sin_cos_turn(b)
    return r * s, r * c


@inline
def normal_rows(out, scale, lane, group, key, call):
    """Fill out with out[r, i] = scale[r] N(0, 1).

    One Philox counter (lane, group of four rows, call) gives four normals.

    Args:
        out: array to fill  (rows, lanes).
        scale: standard deviations  (rows,).
        lane, group: lane and group of four rows of the first number.
        key: key of the generator  (2,) uint32.
        call: index of the call.
    """
    rows, lanes = out.shape
    k0, k1 = key[0], key[1]
    for g in range((rows + 3) // 4):
        r0, r1, r2, r3 = (
            4 * g,
            min(4 * g + 1, rows - 1),
            min(4 * g + 2, rows - 1),
            min(4 * g + 3, rows - 1),
        )
        o0, o1, o2, o3 = out[r0], out[r1], out[r2], out[r3]
        s0, s1, s2, s3 = scale[r0], scale[r1], scale[r2], scale[r3]
        for i in range(lanes):
            a0, a1, a2, a3 = philox(U4(lane + i), U4(group + g), U4(call), U4(0), k0, k1)
            n0, n1 = box_muller(a0, a1)
            n2, n3 = box_muller(a2, a3)
            # Where the last group is short, its rows coincide, and the first row is written last.
            o3[i] = n3 * s3
            o2[i] = n2 * s2
            o1[i] = n1 * s1
            o0[i] = n0 * s0


@kept
@njit(fastmath=FAST, error_model="numpy", nogil=True)
def normal_blocks(desk, first, last, out, scale, key, call, first_block):
    """Fill the blocks of `out` from `first` to before `last`, see fill_normals and sharing."""
    if desk:
        share(desk, last)  # pyright: ignore[reportCallIssue]
        return
    for b in range(first, last):
        normal_rows(out[b], scale, (first_block + b) * out.shape[2], 0, key, call)


def fill_normals(
    out: np.ndarray, scale: np.ndarray, key: np.ndarray, call: int, first: int = 0
) -> None:
    """Fill out with independent normals, out[b, r, l] = scale[r] N(0, 1).

    Args:
        out: array to fill  (blocks, rows, LANES).
        scale: standard deviations  (rows,).
        key: key of the generator  (2,) uint32.
        call: index of the call.
        first: number of the first block.
    """
    on_threads(normal_blocks, len(out), out, scale, key, call, first)
