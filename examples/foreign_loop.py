"""MPPI in somebody else's loop: control(x) gives the next control, the simulator is yours."""

import numpy as np

from quadsim import MPPI, Colored, MPPIConfig
from quadsim.paper.integrator import double_integrator, quadratic_cost

DT = 0.05
system = double_integrator(DT)
mppi = MPPI(
    system,
    quadratic_cost(goal=(0.0, 0.0)),
    Colored(sigma=(1.0, 1.0), gamma=(1.0, 1.0)),
    MPPIConfig(samples=512, horizon=40, dt=DT),
)
x = np.array([2.0, -1.0, 0.0, 0.0])  # position [m], velocity [m/s]
for k in range(120):
    u, stats = mppi.control(x)
    x = np.concatenate([x[:2] + DT * x[2:], x[2:] + DT * u])  # your simulator
    if k % 40 == 39:
        print(f"{(k + 1) * DT:.0f} s: {np.hypot(*x[:2]):.3f} m from the goal, ESS {stats.ess:.0f}")
