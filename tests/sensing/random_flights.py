"""Flights of vehicles that differ from their model, on random commands, without a planner."""

from dataclasses import dataclass, field
from math import inf

import numpy as np

from quadsim.dynamics.quadrotor import Control, State
from quadsim.physics.actuators import Actuators
from quadsim.physics.domain_randomization import Randomization
from quadsim.physics.faults import CommandFault, RotorFault, Window
from quadsim.physics.link import FaultyCommands
from quadsim.rotation import Vec3
from quadsim.vehicle import GRAVITY, Vehicle, load_vehicle

SWIFT = load_vehicle("swift")
STEP = 0.0025
HOVER = Control(0.0, 0.0, 0.0, GRAVITY)


@dataclass
class Ways:
    """Ways in which a vehicle differs from its nominal one."""

    strengths: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    # [s] between which the rotors have these strengths
    since: float = 0.0
    until: float = inf
    varied: Randomization = field(default_factory=Randomization)
    # angular acceleration per thrust [1/m], as by a centre of mass off the middle
    turn: Vec3 = (0.0, 0.0, 0.0)
    # [rad/s^2]
    always: Vec3 = (0.0, 0.0, 0.0)
    # [s] between which no command arrives
    lost: tuple[float, float] = (inf, inf)
    # [s] by which commands are late, and until when
    delay: float = 0.0
    delayed_until: float = inf


def flown(vehicle: Vehicle, ways: Ways, seconds: float, dt=0.01, seed=0, most=0.8):
    """Yield (before, after, command) of a flight on random commands.

    Args:
        vehicle: the nominal vehicle.
        ways: in which the flown one differs.
        seconds: duration.
        dt: control period [s].
        seed: of the commands.
        most: highest command, as a share of the highest thrust.
    """
    rng = np.random.default_rng(seed)
    window = Window(ways.since, ways.until - ways.since)
    faults = [RotorFault(i, share, window) for i, share in enumerate(ways.strengths, 1)]
    actuators = Actuators(ways.varied.vehicle(vehicle), STEP, faults)
    begin, end = ways.lost
    late = [CommandFault(ways.delay, Window(0.0, ways.delayed_until))]
    link = FaultyCommands([CommandFault(inf, Window(begin, end - begin))] if begin < end else late)
    rates = np.zeros(3)
    after = state(rates, GRAVITY, (0.0, 0.0, 0.0))
    u = HOVER
    for k in range(round(seconds / dt)):
        if k % 15 == 0:
            share = rng.uniform(0.3, most)
            u = Control(*rng.uniform(-2.0, 2.0, 3), thrust=share * vehicle.thrust_max)
        before = after
        for i in range(round(dt / STEP)):
            arrived = link.carried(k * dt + i * STEP, u)
            actuators.wrench(arrived, tuple(rates), (0.0, 0.0, 0.0))
            beta = np.array(actuators.angular_acceleration) + ways.always
            beta += actuators.thrust * np.array(ways.turn)
            rates = rates + STEP * beta
        after = state(rates, actuators.thrust, tuple(beta.tolist()))
        yield before, after, u


def state(rates, thrust, beta):
    """Return a state of which only what the rotors do matters."""
    return State.of((0, 0, 0), (0, 0, 0), (1, 0, 0, 0), tuple(map(float, rates)), thrust, beta)


def weak(rotor, share):
    return tuple(share if i == rotor else 1.0 for i in range(4))
