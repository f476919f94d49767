"""How good the estimate of a sensed flight was: short pure functions of a Run."""

from __future__ import annotations

import numpy as np

from quadsim.record.run import Run
from quadsim.sensing.estimate_record import ERRORS


def estimate_errors(run: Run) -> np.ndarray:
    """Estimated less true position of every frame [m].  (frames, 3)"""
    x = run.telemetry
    return np.column_stack([x[f"est_{name}"] - x[name] for name in ("px", "py", "pz")])


def sensing_numbers(run: Run) -> dict | None:
    """None where the planner was given the true state.

    position_rms, position_max: distance between estimated and true position [m]; at_gates: the same
    where gates were passed, RMS [m]; nees: mean, of `nees_expected` degrees of freedom; nis: per
    degree of freedom of the measurements used; refused: share of the measurements taken for
    outliers; in_view: mean number of corners in a picture that showed any; found: share of those
    that was found; unaided: time at the end since the last measurement was used, inertial ones
    aside [s]; estimate_ms: time of an estimate, wall clock [ms].
    """
    x = run.telemetry
    if "est_px" not in x or not len(x["t"]):
        return None
    distance = np.linalg.norm(estimate_errors(run), axis=1)  # (frames,)
    passes = np.searchsorted(x["t"], [gate["t"] for gate in run.gates]).clip(max=len(distance) - 1)
    aided = np.flatnonzero(x["nis_dof"])
    used, refused, in_view = x["nis_dof"].sum(), x["refused"].sum(), x["in_view"]
    return {
        "sensing": run.spec["sensing"]["name"],
        "position_rms": _rms(distance),
        "position_max": float(distance.max()),
        "at_gates": _rms(distance[passes]) if len(passes) else None,
        "nees": float(x["nees"].mean()),
        "nees_expected": ERRORS,
        "nis": float(x["nis"].sum() / used) if used else None,
        "refused": float(refused / (used + refused)) if used + refused else None,
        "in_view": float(in_view[in_view > 0].mean()) if in_view.any() else None,
        "found": float(x["found"].sum() / in_view.sum()) if in_view.any() else None,
        "unaided": float(x["t"][-1] - x["t"][aided[-1] if len(aided) else 0]),
        "estimate_ms": {
            "p50": float(np.median(x["estimate_ms"])),
            "p95": float(np.percentile(x["estimate_ms"], 95)),
        },
    }


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
