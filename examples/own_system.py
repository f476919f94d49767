"""A system of one's own: swing a pendulum on a cart up. `step` and `terms` are plain functions over scalars."""

import numpy as np
from numpy import sqrt

import quadsim
from quadsim import Colored, Cost, System

DT = 0.02


def step(x, u, p, dt):
    """x: position, velocity, cos and sin of the angle from upright, angular rate; u: the cart's acceleration."""
    pos, v, c, s, w = x
    (a,) = u
    gravity, length = p
    w2 = w + (gravity * s - a * c) / length * dt
    c2, s2 = c - s * w2 * dt, s + c * w2 * dt
    n = sqrt(c2 * c2 + s2 * s2)
    return pos + v * dt, v + a * dt, c2 / n, s2 / n, w2


def terms(x, x_next, u, target, crashed, p):
    """Upright, in the middle, at rest. Nothing is reached, nothing crashes."""
    pos, v, c, _, w = x_next
    upright, middle, calm = p
    return upright * (1.0 - c), middle * pos * pos, calm * (w * w + v * v), False, crashed


cart = System(
    name="cart_pole",
    states=("pos", "v", "cos", "sin", "w"),
    controls=("a_cmd",),
    step=step,
    params=(9.81, 0.5),
    dt=DT,
    low=(-20.0,),
    high=(20.0,),
    rest=(0.0,),
)
cost = Cost("swing_up", ("upright", "middle", "calm"), terms, (10.0, 1.0, 0.05), np.zeros((1, 1)))
hanging = (0.0, 0.0, -1.0, 0.0, 0.1)
run = quadsim.fly(
    system=cart,
    cost=cost,
    sampler=Colored((8.0,), (1.0,)),
    start=hanging,
    timeout=5.0,
    samples=2048,
    horizon=75,
    target_ess=50.0,
)
print(run.outcome, "angle from upright at the end:", np.degrees(np.arccos(run.telemetry["cos"][-1])).round(1), "deg")
