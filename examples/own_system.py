"""A system and a cost of one's own: swing a pendulum on a cart up."""

from typing import NamedTuple

import numpy as np
from numpy import sqrt

import quadsim
from quadsim import Colored, Cost, System, Term


class State(NamedTuple):
    pos: float  # of the cart [m]
    v: float  # [m/s]
    cos: float  # of the angle from upright
    sin: float
    w: float  # angular rate [rad/s]


class Control(NamedTuple):
    a_cmd: float  # acceleration of the cart [m/s^2]


class Params(NamedTuple):
    gravity: float  # [m/s^2]
    length: float  # [m]


class Middle(NamedTuple):
    pos: float  # where the cart should stand [m]


def step(x, u, p, dt):
    w = x.w + (p.gravity * x.sin - u.a_cmd * x.cos) / p.length * dt
    c = x.cos - x.sin * w * dt
    s = x.sin + x.cos * w * dt
    norm = sqrt(c * c + s * s)
    return State(pos=x.pos + x.v * dt, v=x.v + u.a_cmd * dt, cos=c / norm, sin=s / norm, w=w)


def upright(x, x_next, u, middle, p):
    return 1.0 - x_next.cos


def in_the_middle(x, x_next, u, middle, p):
    return (x_next.pos - middle.pos) ** 2


def calm(x, x_next, u, middle, p):
    return x_next.w**2 + x_next.v**2


cart = System(
    name="cart_pole",
    state=State,
    control=Control,
    step=step,
    params=Params(gravity=9.81, length=0.5),
    dt=0.02,
    low=(-20.0,),
    high=(20.0,),
    rest=(0.0,),
)
cost = Cost(
    name="swing_up",
    terms=(Term(upright, 10.0), Term(in_the_middle, 1.0), Term(calm, 0.05)),
    row=Middle,
    targets=np.zeros((1, 1)),
)
run = quadsim.fly(
    system=cart,
    cost=cost,
    sampler=Colored((8.0,), (1.0,)),
    start=State(pos=0.0, v=0.0, cos=-1.0, sin=0.0, w=0.1),
    timeout=5.0,
    samples=2048,
    horizon=75,
    target_ess=50.0,
)
print(
    run.outcome,
    "angle from upright at the end:",
    np.degrees(np.arccos(run.telemetry["cos"][-1])).round(1),
    "deg",
)
