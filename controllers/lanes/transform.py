"""Draw normals with a given spectrum, by generated code for inverse Fourier transforms in lanes.

A module is generated for each length n and number B of frequencies that are not zero.

    z_t = sum_{k<n} Z_k e^{2 pi i k t / n},  Z_k = s_k (xi_k + i eta_k),  s_{n-k} = s_k

The real and the imaginary part of z are two independent stationary series whose power at k/n is
s_k^2: the phase of white noise is arbitrary, so no symmetry of Z and no unpacking of halves is
needed. The rows of the output are the z_t in their order, or weighted sums of some z_t each. The
passes go from x to y and back for W lanes at a time. Every stride is a literal in the text, so that
LLVM can prove that the arrays do not overlap.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from textwrap import indent
from types import ModuleType

import numpy as np

from quadsim.controllers.lanes import FAST
from quadsim.controllers.lanes.compiled import load_module
from quadsim.controllers.lanes.passes import passes
from quadsim.controllers.lanes.sharing import on_threads
from quadsim.controllers.lanes.sums import NO_SUMS, Sums

W = 32  # lanes

MODULE = """
import numpy as np
from numba import njit
from quadsim.controllers.lanes.compiled import kept
from quadsim.controllers.lanes.normals import normal_rows
from quadsim.controllers.lanes.sharing import share

F = np.float32

@kept
@njit(fastmath=set({fast}), error_model="numpy", nogil=True)
def transformed(desk, first, last, out, scale, offset, at, parts, turns, key, call, first_pair):
    if desk:
        share(desk, last)
        return
    series, channels, steps, lanes = out.shape
    is_shifted = offset[0] > 0
    x, y = np.empty({size}, F), np.empty({size}, F)
    for b in range(first, last):
        for c in range(channels):
            for g in range(0, lanes, {W}):
                normals = x[: {numbers} * {W}].reshape(({numbers}, {W}))
                lane = (first_pair + b) * lanes + g
                normal_rows(normals, scale[c], lane, c * {groups}, key, call)
{passes}
                for k in range(2 * b, min(2 * b + 2, series)):
                    z = {result}[k % 2 * {half}:]
                    for t in range(steps):
                        row = out[k, c, t]
                        {row}
                    if is_shifted:
                        # z[{W}:] begins with z_1.
                        for t in range(steps):
                            row = out[k, c, t]
                            for l in range({W}):
                                row[g + l] -= offset[t] * z[{W} + l]
"""


# A row of the output is z_t, or a weighted sum
ROW = """
for l in range({W}):
    row[g + l] = z[t * {W} + l]
"""
SUM = """
{starts}
{weights}
for l in range({W}):
    row[g + l] = {sum}
"""


def fill_transformed(
    out: np.ndarray,
    scale: np.ndarray,
    offset: np.ndarray,
    key: np.ndarray,
    call: int,
    first_pair: int,
    n: int,
    sums: Sums = NO_SUMS,
) -> None:
    """Fill out with z_t - offset_t z_1, two series from one transform.

    Args:
        out: array to fill  (series, channels, steps, LANES), at most n steps unless there are sums.
        scale: s of the real parts, then the same s of the imaginary parts, in the order of
            `passes.frequencies`  (channels, 2 B).
        offset: factors on z_1; if the first factor is zero, all are zero  (steps,).
        key: key of the generator  (2,) uint32.
        call: index of the call.
        first_pair: number of the first pair of series, which seeds the normals.
        n: length of the transform, a multiple of B.
        sums: the weighted sums that replace z_t.
    """
    module, turns = _module(n, scale.shape[1] // 2, sums.terms)
    pairs = (len(out) + 1) // 2
    loop = module.transformed
    on_threads(loop, pairs, out, scale, offset, *sums, turns, key, call, first_pair)


def transform_loop(n: int, band: int, terms: int = 0) -> Callable:
    """Return the compiled loop of a transform, see `_module`."""
    return _module(n, band, terms)[0].transformed


@cache
def _module(n: int, band: int, terms: int) -> tuple[ModuleType, np.ndarray]:
    """Return the loop of a transform, and its twiddle factors e^{i phi}  (turns, 2).

    Args:
        n: length of the transform.
        band: B, the number of frequencies that are not zero.
        terms: number of terms of the sums that are its rows; 0: the rows are the z_t.
    """
    text, result, turns = passes(n, W, band)
    source = MODULE.format(
        n=n,
        W=W,
        size=2 * n * W,
        half=n * W,
        numbers=2 * band,
        groups=-(-2 * band // 4),
        result=result,
        fast=sorted(FAST),
        passes=indent(text.strip("\n"), " " * 16),
        row=indent(_row(terms).strip("\n"), " " * 24).lstrip(),
    )
    digest = hashlib.sha256(source.encode()).hexdigest()[:16]
    module = load_module(f"transform_{n}_{band}_{digest}", source)
    table = np.array([(turn.real, turn.imag) for turn in turns], np.float32).reshape(-1, 2)
    return module, table


def _row(terms: int) -> str:
    """Return the lines that store one row of the output, a sum of some terms or z_t itself."""
    if not terms:
        return ROW.format(W=W)
    numbers = range(terms)
    return SUM.format(
        W=W,
        starts="; ".join(f"z{j} = z[at[t, {j}] * {W}:]" for j in numbers),
        weights="; ".join(f"p{j} = parts[c, t, {j}]" for j in numbers),
        sum=" + ".join(f"p{j} * z{j}[l]" for j in numbers),
    )
