"""A cost term of one's own: fast yaw costs. `terms` is a plain function over scalars, compiled into the rollouts."""

from dataclasses import replace

import quadsim
from controllers.costs import Cost
from controllers.costs.race import terms as race_terms

YAW_WEIGHT = 0.05  # per (rad/s)^2


def terms(x, x_next, u, target, crashed, p):
    """The racing terms and one more; reached and crashed stay last."""
    q = race_terms(x, x_next, u, target, crashed, p)
    wz = x_next[12]
    return q[:9] + (YAW_WEIGHT * wz * wz,) + q[9:]  # noqa: RUF005 (what the compiler understands)


def slow_yaw(cost: Cost) -> Cost:
    return replace(cost, name="race, slow yaw", term_names=(*cost.term_names, "yaw"), terms=terms)


run = quadsim.fly("figure8", cost=slow_yaw, laps=1, samples=1024)
print(run.outcome, run.laps, "largest yaw rate", abs(run.telemetry["wz"]).max().round(2), "rad/s")
