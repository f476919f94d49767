"""Where the time of a control step goes, beside what the machine could do at most."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator

import numpy as np

from controllers.mppi import MPPI, padded, weights
from controllers.rollout.lanes import LANES
from controllers.rollout.reduce import weighted_mean
from quadsim.app.bench.cases import Case, controller
from quadsim.app.bench.timing import median_ms


def stages(case: Case, seconds: float) -> Iterator[tuple[str, float]]:
    """(what, ms) of one iteration at the paper's budget; `rest` is what the whole step takes beyond its parts."""
    mppi, x = controller(case)
    whole = median_ms(lambda: mppi.control(x), seconds)
    z = mppi.perturbations().copy()
    costs = np.empty((-(-case.samples // LANES), LANES), z.dtype)
    mppi.rollout(x, mppi.plan, z, 0, costs)
    J = costs.ravel()[: case.samples].astype(float)
    w = weights(J, mppi.temperature)
    parts = {
        "noise": lambda: mppi.sampler.sample(1),
        "rollouts": lambda: mppi.rollout(x, mppi.plan, z, 0, costs),
        "weights": lambda: padded(weights(costs.ravel()[: case.samples].astype(float), mppi.temperature)),
        "weighted mean": lambda: weighted_mean(z, mppi.plan, mppi.low, mppi.high, padded(w)),
    }
    total = 0.0
    for name, call in parts.items():
        ms = median_ms(call, seconds)
        total += ms
        yield name, ms
    yield "rest", whole / case.iterations - total


def work(mppi: MPPI) -> tuple[int, int]:
    """(arithmetic operations, bytes) of one sample and step of the rollout: counted in the text of step and terms.

    The perturbations are read once; everything else stays in the first-level cache.
    """
    operations = count(mppi.system.step) + count(mppi.cost.terms) + len(mppi.cost.term_names)
    return operations, 4 * len(mppi.system.controls)


def count(function: Callable) -> int:
    """Arithmetic, comparisons and calls in a plain function, those it calls included."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    called = inspect.getclosurevars(function).globals.values()
    own = sum(isinstance(node, ast.BinOp | ast.Compare | ast.Call) for node in ast.walk(tree))
    return own + sum(count(f) for f in called if inspect.isfunction(f))
