"""A point that is pushed about a plane, and Algorithm 1 written naively for it, for the tests of
MPPI."""

from dataclasses import fields, replace
from typing import NamedTuple

import numpy as np

from quadsim.controllers.config import MPPIConfig
from quadsim.controllers.costs import Cost, Term, evaluate
from quadsim.controllers.lanes.layout import from_lanes
from quadsim.controllers.mppi import MPPI
from quadsim.controllers.samplers import SAMPLERS
from quadsim.dynamics import System

T = 40  # as in tests.small, so that one transform of colored sampling is compiled
START = np.array([1.0, -0.5, 0.2, 0.0])
REST = np.array([0.0, 0.5])
SAMPLING = {"sigma": (0.8, 0.5), "gamma": (1.0, 0.5)}  # of every sampler that has them
PLAIN = MPPIConfig(samples=200, horizon=T, iterations=1, dt=0.1, temperature=0.1, rest_fraction=0.1)


class White:
    """A sampler of one's own: Gaussian, in plain numpy."""

    def __init__(self, sd):
        self.sd = sd

    def sample(self, rng, samples, horizon, controls):
        return rng.normal(size=(samples, horizon, controls)) * self.sd


class State(NamedTuple):
    px: float
    py: float
    vx: float
    vy: float


class Control(NamedTuple):
    ax: float
    ay: float


class Params(NamedTuple):
    drag: float


class Goal(NamedTuple):
    x: float
    y: float


def step(x, u, p, dt):
    return State(
        px=x.px + x.vx * dt,
        py=x.py + x.vy * dt,
        vx=x.vx + (u.ax - p.drag * x.vx) * dt,
        vy=x.vy + (u.ay - p.drag * x.vy) * dt,
    )


def distance(x, x_next, u, goal, p):
    ex = x_next.px - goal.x
    ey = x_next.py - goal.y
    return ex * ex + ey * ey


def effort(x, x_next, u, goal, p):
    return u.ax * u.ax


def far_off(x, x_next, u, goal, p):
    return x_next.px - goal.x > 1e6


POINT = System(
    name="point",
    state=State,
    control=Control,
    step=step,
    params=Params(drag=0.1),
    dt=0.1,
    low=(-1.5, -1.0),
    high=(1.5, 2.0),
    rest=tuple(REST),
)
GOAL = Cost(
    "goal", (Term(distance, 1.0), Term(effort, 0.05)), Goal, np.zeros((1, 2)), reached=far_off
)


def make_sampler(name, **numbers):
    """The registered sampler of this name with those of the numbers that it has."""
    kind = SAMPLERS[name]
    return kind(**{f.name: numbers[f.name] for f in fields(kind) if f.name in numbers})


def make(seed=12, sampler="gaussian", system=POINT, sigma=SAMPLING["sigma"], **changes):
    """sampler: a name, or an object of one's own."""
    config = replace(PLAIN, **changes)
    named = isinstance(sampler, str)
    mppi = MPPI(
        system,
        GOAL,
        make_sampler(sampler, **SAMPLING | {"sigma": sigma}) if named else sampler,
        config,
        seed,
    )
    # any plan but rest
    mppi.plan = REST + 0.3 * np.sin(np.arange(2 * config.horizon)).reshape(-1, 2)
    return mppi


def naive_cost(v):
    x, total = State(*START), 0.0
    for u in v:
        x_next = POINT.next(x, u)
        total += sum(evaluate(GOAL, x, x_next, Control(*u), GOAL.targets[0]).terms.values())
        x = x_next
    return total / len(v)


def naive(U, z, temperature, step_size=1.0):
    """Algorithm 1.  U (T, n_u), z (M, n_u, T)"""
    V = np.clip(U + z.swapaxes(1, 2), POINT.low, POINT.high)
    J = np.array([naive_cost(v) for v in V])
    w = np.exp(-(J - J.min()) / temperature)
    w /= w.sum()
    return U + step_size * np.tensordot(w, V - U, 1), 1 / np.sum(w**2)


def drawn(mppi, call=1):
    """The samples of a call as the sampler made them."""
    return from_lanes(mppi.sampler.sample(call).copy(), mppi.config.samples, mppi.config.horizon)


def perturbed(mppi):
    """The perturbations of the present plan in the first iteration.  (M, n_u, T)"""
    first = mppi.begin_iteration(START, target=0)
    z = mppi.perturbations(first, slice(0, mppi.samples))
    return from_lanes(z, mppi.samples, mppi.config.horizon)
