"""What a control step has to do at least, and the time that a machine's arithmetic and memory need for it.

Operations are counted in the texts of the plain functions: additions, multiplications, divisions, comparisons, bit
operations, roots and selects are one each. A machine is measured by a matrix product, which counts a fused
multiply-add as two: code that has nothing to fuse reaches half of its roofline.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import log2

from controllers.mppi import MPPI
from controllers.rollout.inline import WORDS
from controllers.rollout.layout import CHUNK
from controllers.rollout.normals import box_muller, philox
from quadsim.app.bench.roofline import bandwidth_gb, peak_gflops
from quadsim.record.provenance import cpu_name

CONSTANT = {"F", "U4", "U8", "math", "np"}  # names in arithmetic that is done before the loop
FLOAT = 4  # bytes


@dataclass(frozen=True)
class Work:
    """Of one step of one sample."""

    operations: float
    bytes: float  # of perturbations read or written; all else stays in the first-level cache


@dataclass(frozen=True)
class Machine:
    """What this one does at most, on all threads in use."""

    cpu: str
    threads: int
    peak_gflops: float
    bandwidth_gb: float  # memory
    chunk_bandwidth_gb: float  # over as many bytes as a chunk of perturbations at the paper's budget has


def measure_machine(threads: int) -> Machine:
    chunk = CHUNK * 150 * 4  # numbers; the triad has three arrays
    return Machine(cpu_name(), threads, peak_gflops(), bandwidth_gb(), bandwidth_gb(chunk // 3))


def floor_ns(work: Work, machine: Machine) -> float:
    """The roofline: arithmetic and traffic overlap, the longer of both counts. Chunks of samples stay in the caches."""
    return max(work.operations / machine.peak_gflops, work.bytes / machine.chunk_bandwidth_gb)


def work(mppi: MPPI, sampler: str) -> dict[str, Work]:
    """Of each part of an iteration. Weights are a few operations a sample, not a step: left out."""
    n_u, terms = len(mppi.system.controls), len(mppi.cost.term_names)
    # clip(U + z) is three operations a control; every term is added to the sum
    rollouts = count(mppi.system.step) + count(mppi.cost.terms) + terms + 3 * n_u
    mean = 6 * n_u  # s += w (clip(U + z) - U); fewer where a block of samples weighs nothing
    noise = _noise(sampler, n_u, mppi.config.horizon)
    return noise | {"rollouts": Work(rollouts, FLOAT * n_u), "weighted mean": Work(mean, FLOAT * n_u)}


def _noise(sampler: str, n_u: int, horizon: int) -> dict[str, Work]:
    """Colored, law exact: 2 n normals become two series of n = 2 T numbers by 5 n log2 n operations, as FFTW's
    benchmark counts them; the normals stay in the first-level cache.
    """
    # four from one counter, each scaled; the two additions a round to the key serve all lanes
    normal = (count(philox) - 2 * 10 + 2 * count(box_muller)) / 4 + 1
    if sampler == "colored":
        return {"normals": Work(n_u * normal, 0), "transform": Work(n_u * 2.5 * log2(2 * horizon), FLOAT * n_u)}
    if sampler == "log_normal":  # two normals, a ceiling, exp and a product, from memory to memory
        return {"normals": Work(2 * n_u * normal, 2 * FLOAT * n_u), "transform": Work(3 * n_u, 3 * FLOAT * n_u)}
    return {"normals": Work(n_u * normal, FLOAT * n_u)}


def count(function: Callable) -> int:
    """Operations of a plain function, of every call it makes and every turn of its loops."""
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
        return inside + any(isinstance(n, ast.Name) and n.id not in CONSTANT for n in ast.walk(node))
    return inside


def _of_call(called: ast.expr, names: Mapping) -> int:
    name = called.attr if isinstance(called, ast.Attribute) else ast.unparse(called)
    if name in WORDS:  # one operation each; a cast is none
        return 1
    return count(names[name]) if name in names and inspect.isfunction(inspect.unwrap(names[name])) else 0
