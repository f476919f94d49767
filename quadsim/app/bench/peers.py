"""The same model and cost, without gates, through pytorch-mppi and through JAX, in the same run as ours.

Before anything is timed, every one of them must find the same costs for the same noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec

import numpy as np

from controllers.mppi import MPPI
from controllers.presets import preset
from controllers.rollout.lanes import Rollout
from controllers.rollout.layout import LANES
from quadsim.app.bench.cases import controller, paper_case
from quadsim.app.bench.jax_peer import JaxPeer
from quadsim.app.bench.point_cost import point_cost
from quadsim.app.bench.timing import median_ms
from quadsim.app.bench.torch_peer import TorchPeer
from quadsim.app.flags import UsageError

AGREEMENT = 1e-3  # relative, of float32 costs over 150 steps


def require_peers() -> None:
    """Raises UsageError without the extra, before minutes of timing."""
    for name in ("torch", "pytorch_mppi", "jax"):
        if find_spec(name) is None:
            raise UsageError(f"--peers: {name} is not installed: pip install 'quadsim[peers]'")


def compare(seconds: float) -> list[dict]:
    """One row a peer: {name, ms_p50, ours_ms, ratio, largest_difference}."""
    mppi, x = controller(paper_case("quadrotor", "gaussian"))
    sampling = preset("paper", "gaussian").sampling
    ours = MPPI(mppi.system, point_cost(), sampling, replace(mppi.config, rest_fraction=0.0))
    return [
        _against(ours, x, name, load(ours.system, ours.cost, ours), seconds)
        for name, load in {"pytorch-mppi": TorchPeer, "JAX": JaxPeer}.items()
    ]


def _against(ours: MPPI, x: np.ndarray, name: str, peer: TorchPeer | JaxPeer, seconds: float) -> dict:
    """Costs first, then one after the other in one run, ours again beside each."""
    difference = largest_difference(ours, peer.costs, x)
    ours_ms = median_ms(lambda: ours.control(x), seconds)
    theirs = median_ms(lambda: peer.control(x), seconds)
    row = {"name": name, "ms_p50": theirs, "ours_ms": ours_ms, "ratio": theirs / ours_ms}
    return row | {"largest_difference": difference}


def largest_difference(ours: MPPI, costs: Callable, x: np.ndarray) -> float:
    """Between their costs and ours for the same noise, relative. Raises ValueError beyond AGREEMENT."""
    z = ours.sampler.sample(7).copy()  # (blocks, n_u, T, LANES)
    mine = np.empty((len(z), LANES), np.float32)
    Rollout(ours.system, ours.cost)(x, ours.plan, z, 0, mine)
    v = z.transpose(0, 3, 2, 1).reshape(-1, z.shape[2], z.shape[1]) + ours.plan.astype(np.float32)  # (M, T, n_u)
    theirs = costs(x, np.clip(v, np.float32(ours.low), np.float32(ours.high)))
    difference = float(np.max(np.abs(theirs - mine.ravel()) / np.abs(mine.ravel())))
    if difference > AGREEMENT:
        raise ValueError(f"bench: expected equal costs for equal noise, got a relative difference of {difference:g}")
    return difference
