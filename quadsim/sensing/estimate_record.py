"""The columns of a run that describe an estimate, and its consistency with the true state.

The normalised estimation error squared (NEES), e^T P^-1 e of position, velocity and attitude, has
the mean 9 if P is the covariance of the error; the normalised innovation squared (NIS) of a
measurement has the mean of its degrees of freedom (Bar-Shalom, Li and Kirubarajan, "Estimation
with applications to tracking and navigation", 2001, section 5.4).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from quadsim.dynamics.quadrotor import State
from quadsim.physics.plant_state import PlantState
from quadsim.rotation import between
from quadsim.sensing.estimation.updates import Innovation
from quadsim.sensing.nominal import Nominal

ESTIMATE_UNITS = {
    **dict.fromkeys(("est_px", "est_py", "est_pz"), "m"),
    **dict.fromkeys(("est_vx", "est_vy", "est_vz"), "m/s"),
    **dict.fromkeys(("est_qw", "est_qx", "est_qy", "est_qz"), "1"),
    **dict.fromkeys(("cov_xx", "cov_xy", "cov_xz", "cov_yy", "cov_yz", "cov_zz"), "m^2"),
    # 9 degrees of freedom
    "nees": "1",
    # normalised innovation squared of this period's measurements, and its degrees of freedom
    "nis": "1",
    "nis_dof": "1",
    # degrees of freedom of rejected measurements
    "refused": "1",
    # corners in view of the last picture of this period, and corners found in it
    "in_view": "1",
    "found": "1",
    "estimate_ms": "ms",
}
# components of position, velocity and attitude
ERRORS = 9


def estimate_row(
    state: PlantState[State],
    nominal: Nominal,
    P: np.ndarray,
    innovations: Sequence[Innovation],
    picture: tuple[int, int],
    spent: float,
) -> tuple[float, ...]:
    """Return the columns of ESTIMATE_UNITS for one frame.

    Args:
        state: the true state.
        nominal: the estimated state.
        P: covariance of its error  (n, n).
        innovations: innovations of the measurements taken in this period.
        picture: numbers of corners in view and of corners found in the last picture of this period.
        spent: time that the estimate took [ms].
    """
    true = State(*state.x)
    error = np.array(
        [
            *np.subtract(true.position, nominal.position),
            *np.subtract(true.velocity, nominal.velocity),
            *between(nominal.attitude, true.attitude),
        ]
    )
    nees = float(error @ np.linalg.solve(P[:ERRORS, :ERRORS], error))
    nis = sum(i.nis for i in innovations)
    used = sum(i.used for i in innovations)
    refused = sum(i.refused for i in innovations)
    covariance = P[np.triu_indices(3)].tolist()
    estimate = (*nominal.position, *nominal.velocity, *nominal.attitude)
    return (*estimate, *covariance, nees, nis, used, refused, *picture, spent)
