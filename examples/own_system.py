"""A system and a cost of one's own: MPPI swings a pendulum on a cart up."""

from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from numpy import cos, sin

from quadsim import MPPI, Colored, Cost, MPPIConfig, System, Term


# A system is a step function over named scalars.
class State(NamedTuple):
    position: float  # of the cart [m]
    velocity: float  # [m/s]
    angle: float  # of the pendulum from upright [rad]
    rate: float  # [rad/s]


class Control(NamedTuple):
    acceleration: float  # of the cart [m/s^2]


class Params(NamedTuple):
    gravity: float  # [m/s^2]
    length: float  # [m]


def step(x, u, p, dt):
    torque = (p.gravity * sin(x.angle) - u.acceleration * cos(x.angle)) / p.length
    rate = x.rate + torque * dt
    return State(
        position=x.position + x.velocity * dt,
        velocity=x.velocity + u.acceleration * dt,
        angle=x.angle + rate * dt,
        rate=rate,
    )


params = Params(gravity=9.81, length=0.5)
limits = {"low": (-20.0,), "high": (20.0,), "rest": (0.0,)}
cart = System("cart_pole", State, Control, step, params, dt=0.02, **limits)


# A cost is a sum of weighted terms. They are given the target: here the middle of the rail.
class Middle(NamedTuple):
    position: float  # [m]


def upright(x, x_next, u, middle, p):
    return 1.0 - cos(x_next.angle)


def in_the_middle(x, x_next, u, middle, p):
    return (x_next.position - middle.position) ** 2


def calm(x, x_next, u, middle, p):
    return x_next.rate**2 + x_next.velocity**2


terms = (Term(upright, 10.0), Term(in_the_middle, 1.0), Term(calm, 0.05))
cost = Cost("swing_up", terms, Middle, targets=np.array([[0.0]]))

# The planner, and the loop: plan, then step. In place of cart.next stands your own simulator.
config = MPPIConfig(samples=2048, horizon=75, dt=cart.dt, target_ess=50.0)
mppi = MPPI(cart, cost, Colored(sigma=(8.0,), gamma=(1.0,)), config)
x = State(position=0.0, velocity=0.0, angle=np.pi, rate=0.1)
angles = []
for _ in range(250):
    u, stats = mppi.control(np.array(x))
    x = cart.next(x, u)
    angles.append(np.degrees(np.angle(np.exp(1j * x.angle))))  # within -180..180
print(f"angle from upright at the end: {abs(angles[-1]):.1f} deg")

plt.plot(cart.dt * np.arange(len(angles)), angles)
plt.xlabel("t [s]")
plt.ylabel("angle from upright [deg]")
plt.savefig("swing_up.png")
