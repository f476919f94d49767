"""What a run keeps of an estimate beside the truth, and how consistent the two are.

The normalised estimation error squared (NEES), e^T P^-1 e of position, velocity and attitude, has the mean 9 if the
covariance P tells the truth; the normalised innovation squared (NIS) of a measurement has its number of degrees of
freedom (Bar-Shalom, Li and Kirubarajan, "Estimation with applications to tracking and navigation", 2001, section 5.4).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from quadsim.physics.plant_state import PlantState
from quadsim.rotation import between
from quadsim.sensing.estimation.nominal import Nominal
from quadsim.sensing.estimation.updates import Innovation
from quadsim.systems.quadrotor import State

ESTIMATE_UNITS = {
    **dict.fromkeys(("est_px", "est_py", "est_pz"), "m"),
    **dict.fromkeys(("est_vx", "est_vy", "est_vz"), "m/s"),
    **dict.fromkeys(("est_qw", "est_qx", "est_qy", "est_qz"), "1"),
    **dict.fromkeys(("cov_xx", "cov_xy", "cov_xz", "cov_yy", "cov_yz", "cov_zz"), "m^2"),
    "nees": "1",  # 9 degrees of freedom
    "nis": "1",  # of the measurements taken in this period
    "nis_dof": "1",  # their degrees of freedom
    "refused": "1",  # degrees of freedom of measurements taken for outliers
    "in_view": "1",  # corners that stood in the last picture of this period
    "found": "1",  # corners that were found in it
    "estimate_ms": "ms",
}
ERRORS = 9  # position, velocity, attitude


def estimate_row(
    state: PlantState[State],
    nominal: Nominal,
    P: np.ndarray,
    innovations: Sequence[Innovation],
    seen: tuple[int, int],
    spent: float,
) -> tuple[float, ...]:
    """The columns of ESTIMATE_UNITS for one frame."""
    true = state.x
    e = np.array(
        [
            *(a - b for a, b in zip(true.position, nominal.p, strict=True)),
            *(a - b for a, b in zip(true.velocity, nominal.v, strict=True)),
            *between(nominal.q, true.attitude),
        ]
    )
    nees = float(e @ np.linalg.solve(P[:ERRORS, :ERRORS], e))
    nis, dof, refused = (sum(getattr(i, name) for i in innovations) for name in ("nis", "used", "refused"))
    covariance = P[np.triu_indices(3)].tolist()
    return (*nominal.p, *nominal.v, *nominal.q, *covariance, nees, nis, dof, refused, *seen, spent)
