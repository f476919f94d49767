"""Normals with a spectrum: an inverse Fourier transform in lanes, as generated code.

There is a module for each length n.

    z_t = sum_{k<n} Z_k e^{2 pi i k t / n},  Z_k = s_k (xi_k + i eta_k),  s_{n-k} = s_k

The real and the imaginary part of z are two independent stationary series whose power at k/n is
s_k^2: white noise has no phase to keep, so no symmetry of Z and no unpacking of halves is needed.
W lanes at a time pass from x to y and back, and every distance is a number in the text, so that
LLVM sees that nothing overlaps.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from functools import cache
from textwrap import indent
from types import ModuleType

import numpy as np

from controllers.lanes import FAST, normals
from controllers.lanes.compiled import load_module
from controllers.lanes.passes import passes

W = 32  # lanes

MODULE = """# on normals {normals}
import numpy as np
from numba import njit, prange
from controllers.lanes.compiled import kept
from controllers.lanes.normals import normal_rows

F = np.float32

@njit(fastmath=set({fast}), error_model="numpy")
def settle(z, offset):
    z1 = z[{W} : 2 * {W}].copy()
    for t in range(len(offset)):
        for l in range({W}):
            z[t * {W} + l] -= offset[t] * z1[l]

@kept
@njit(fastmath=set({fast}), error_model="numpy", parallel=True, nogil=True)
def transformed(out, scale, offset, turns, key, call, first):
    series, channels, steps, lanes = out.shape
    for b in prange((series + 1) // 2):
        x, y = np.empty({size}, F), np.empty({size}, F)
        for c in range(channels):
            for g in range(0, lanes, {W}):
                normal_rows(x.reshape((2 * {n}, {W})), scale[c], (first + b) * lanes + g,
                            c * {groups}, key, call)
{passes}
                for k in range(2 * b, min(2 * b + 2, series)):
                    z = {result}[k % 2 * {half}:]
                    if offset[0] > 0:
                        settle(z, offset)
                    for t in range(steps):
                        row = out[k, c, t]
                        for l in range({W}):
                            row[g + l] = z[t * {W} + l]
"""


def fill_transformed(
    out: np.ndarray, scale: np.ndarray, offset: np.ndarray, key: np.ndarray, call: int, first: int
) -> None:
    """Fill out with z_t - offset_t z_1, two series from one transform.

    Args:
        out: array to fill  (series, channels, steps, LANES), at most n steps.
        scale: s of the real parts, then of the imaginary parts, which are the same
            (channels, 2 n).
        offset: all zero where the first one is  (steps,).
        key: key of the generator  (2,) uint32.
        call: index of the call.
        first: number of the first pair of series, which the normals depend on.
    """
    module, turns = _module(scale.shape[1] // 2)
    module.transformed(out, scale, offset, turns, key, call, first)


def transform_loop(n: int) -> Callable:
    """Return the compiled loop for this length."""
    return _module(n)[0].transformed


@cache
def _module(n: int) -> tuple[ModuleType, np.ndarray]:
    """Return the loop for this length, and the turns e^{i phi} of its passes  (turns, 2)."""
    text, result, turns = passes(n, W)
    source = MODULE.format(
        n=n,
        W=W,
        size=2 * n * W,
        half=n * W,
        groups=-(-2 * n // 4),
        result=result,
        fast=sorted(FAST),
        # The code is compiled anew where the normals that it inlines have changed.
        normals=hashlib.sha256(inspect.getsource(normals).encode()).hexdigest(),
        passes=indent(text.strip("\n"), " " * 16),
    )
    digest = hashlib.sha256(source.encode()).hexdigest()[:16]
    module = load_module(f"transform_{n}_{digest}", source)
    table = np.array([(turn.real, turn.imag) for turn in turns], np.float32).reshape(-1, 2)
    return module, table
