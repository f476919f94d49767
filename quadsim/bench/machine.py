"""The work that a control step needs at least, and the time that this machine needs for it: a
roofline.

Operations are counted in the traced step and cost of a rollout, and in the source of the random
generator: additions, multiplications, divisions, comparisons, bit operations, roots and selects are
one each. A machine is measured by a matrix product, which counts a fused multiply-add as two: code
that has nothing to fuse reaches half of its roofline.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import log2
from time import perf_counter

import numpy as np
from numba import njit, prange

from controllers.lanes.compiled import kept
from controllers.lanes.layout import CHUNK
from controllers.lanes.normals import box_muller, philox
from controllers.lanes.planner_loops import operations
from controllers.mppi import MPPI
from quadsim.record.provenance import cpu_name

CONSTANT = {"F", "U4", "U8", "math", "np"}  # names in arithmetic that is done before the loop
ONE_OPERATION = {"sqrt", "exp", "where", "minimum", "maximum", "abs"}
FLOAT = 4  # bytes


@dataclass(frozen=True)
class Work:
    """Of one step of one sample."""

    operations: float
    bytes: float  # of perturbations read or written; all else stays in the first-level cache


@dataclass(frozen=True)
class Machine:
    """What the arithmetic and the memory reach at most, on all threads in use."""

    cpu: str
    threads: int
    peak_gflops: float
    bandwidth_gb: float  # memory
    # over as many bytes as a chunk of perturbations at the paper's budget has
    chunk_bandwidth_gb: float


def measure_machine(threads: int) -> Machine:
    chunk = CHUNK * 150 * 4  # numbers; the triad has three arrays
    return Machine(cpu_name(), threads, peak_gflops(), bandwidth_gb(), bandwidth_gb(chunk // 3))


def peak_gflops(size: int = 2048) -> float:
    """float32 matrix product by numpy's BLAS on all cores, the highest rate of arithmetic in
    practice [GFLOP/s]."""
    a = np.ones((size, size), np.float32)
    out = np.empty_like(a)
    return 2 * size**3 / _fastest(lambda: np.matmul(a, a, out=out)) / 1e9


def bandwidth_gb(size: int = 20_000_000) -> float:
    """Triad a = b + 3 c over arrays, by default far larger than the caches; three arrays are moved
    [GB/s]."""
    a, b, c = (np.ones(size, np.float32) for _ in range(3))
    return 3 * a.nbytes / _fastest(lambda: triad(a, b, c)) / 1e9


@kept
@njit(parallel=True)
def triad(a, b, c):
    for i in prange(a.size):
        a[i] = b[i] + np.float32(3) * c[i]


def _fastest(call: Callable[[], object], repeats: int = 5) -> float:
    """The shortest of some calls after a first one that is not timed [s]."""
    call()
    seconds = []
    for _ in range(repeats):
        began = perf_counter()
        call()
        seconds.append(perf_counter() - began)
    return min(seconds)


def floor_ns(work: Work, machine: Machine) -> float:
    """The roofline: arithmetic and traffic overlap, the longer of both counts. Chunks of samples
    stay in the caches."""
    return max(work.operations / machine.peak_gflops, work.bytes / machine.chunk_bandwidth_gb)


def work(mppi: MPPI, sampler: str) -> dict[str, Work]:
    """Of each part of an iteration. Weights are a few operations for each sample, not for each
    step: left out."""
    n_u = len(mppi.system.controls)
    rollouts = operations(mppi.system, mppi.cost)
    mean = 6 * n_u  # s += w (clip(U + z) - U); fewer where all weights of a block of samples are 0
    noise = _noise(sampler, n_u, mppi.config.horizon)
    return noise | {
        "rollouts": Work(rollouts, FLOAT * n_u),
        "weighted mean": Work(mean, FLOAT * n_u),
    }


def _noise(sampler: str, n_u: int, horizon: int) -> dict[str, Work]:
    """Colored, method exact: 2 n normals become two series of n = 2 T numbers by 5 n log2 n
    operations, as FFTW's benchmark counts them; the normals stay in the first-level cache.
    """
    # four from one counter, each scaled; the two additions a round to the key serve all lanes
    normal = (count(philox) - 2 * 10 + 2 * count(box_muller)) / 4 + 1
    if sampler == "colored":
        return {
            "normals": Work(n_u * normal, 0),
            "transform": Work(n_u * 2.5 * log2(2 * horizon), FLOAT * n_u),
        }
    if sampler == "log_normal":  # two normals, a ceiling, exp and a product, from memory to memory
        return {
            "normals": Work(2 * n_u * normal, 2 * FLOAT * n_u),
            "transform": Work(3 * n_u, 3 * FLOAT * n_u),
        }
    return {"normals": Work(n_u * normal, FLOAT * n_u)}


def count(function: Callable) -> int:
    """Operations of a plain function, with the functions that it calls and every pass through its
    loops."""
    plain = inspect.unwrap(function)
    tree = ast.parse(textwrap.dedent(inspect.getsource(plain))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    names = inspect.getclosurevars(plain).globals
    return sum(_operations(node, names) for node in tree.body)


def _operations(node: ast.AST, names: Mapping) -> int:
    if isinstance(node, ast.Subscript):  # an index is no arithmetic
        return 0
    inside = sum(_operations(child, names) for child in ast.iter_child_nodes(node))
    if isinstance(node, ast.For):  # over range(constant)
        assert isinstance(node.iter, ast.Call)
        return inside * ast.literal_eval(node.iter.args[0])
    if isinstance(node, ast.Call):
        return inside + _of_call(node.func, names)
    if isinstance(node, ast.BinOp | ast.Compare):
        return inside + any(
            isinstance(n, ast.Name) and n.id not in CONSTANT for n in ast.walk(node)
        )
    return inside


def _of_call(called: ast.expr, names: Mapping) -> int:
    name = called.attr if isinstance(called, ast.Attribute) else ast.unparse(called)
    if name in ONE_OPERATION:  # one operation each; a cast is none
        return 1
    return (
        count(names[name])
        if name in names and inspect.isfunction(inspect.unwrap(names[name]))
        else 0
    )
