"""Logs of flights that are known exactly: a vehicle in the rigid world, with chosen signals."""

from dataclasses import replace
from functools import cache

import numpy as np

from quadsim.course import Start, load_course
from quadsim.logs.flight_log import FlightLog
from quadsim.physics.actuators import Actuators
from quadsim.physics.plant import RigidPlant
from quadsim.rotation import to_body
from quadsim.vehicle import GRAVITY, load_vehicle

DT = 1 / 400  # of the plant [s]
EVERY = 2  # steps of the plant in a row of the log
LATE = 0.02  # latency of the vehicle, and time between a motor's command and its effect [s]
TRUE = load_vehicle("kingfisher").but(latency=LATE)
SIGNALS = ("position", "velocity", "quaternion", "body_rates", "specific_force")
NOISE = {"body_rates": 0.02, "specific_force": 0.04, "velocity": 0.02, "position": 0.002}


class Recorded(Actuators):
    """Actuators that keep the speeds which the motors were asked for."""

    def __init__(self, *args):
        super().__init__(*args)
        self.asked = self.motors.speeds
        self._follow = self.motors.follow
        self.motors.follow = self.keep

    def keep(self, commands, *health):
        self.asked = tuple(commands)
        return self._follow(self.asked, *health)


@cache
def flight(seconds=8.0, yaw=2.0, vehicle=TRUE, seed=1):
    """Return a log without noise of steps in rates and thrust, about hover.

    Args:
        seconds: duration.
        yaw: largest commanded yaw rate [rad/s].
        vehicle: what flies.
        seed: of the steps.
    """
    rng = np.random.default_rng(seed)
    start = Start((0.0, 0.0, 300.0), 0.0)
    plant = RigidPlant(load_course("figure8"), vehicle, DT, start=start, actuators=Recorded)
    rows = []
    held = np.zeros(4)
    for k in range(round(seconds / DT)):
        if k % 32 == 0:
            held = rng.uniform(-1.0, 1.0, 4) * (4.0, 4.0, yaw, 4.0)
        x = plant.state.x
        ux, uy, _ = to_body(x.attitude, (0.0, 0.0, 1.0))
        wx, wy, wz, more = held
        command = (wx - 5.0 * uy, wy + 5.0 * ux, wz, GRAVITY + more - 0.5 * x.vz)
        before = x.velocity
        actuators = plant._actuators
        plant.step(command)
        after = plant.state.x
        # What an accelerometer measures in the row that follows
        rise = [(b - a) / DT for a, b in zip(before, after.velocity, strict=True)]
        force = to_body(x.attitude, (rise[0], rise[1], rise[2] + GRAVITY))
        rows.append((x, force, actuators.asked, command))
    states = np.array([row[0] for row in rows])
    force = np.array([rows[0][1]] + [row[1] for row in rows[:-1]])
    asked = np.array([row[2] for row in rows]) / vehicle.rotors.motor_omega_max
    # The motors' commands are logged one latency before they act.
    early = round(vehicle.latency / DT)
    asked = np.concatenate([asked[early:], np.repeat(asked[-1:], early, axis=0)])
    commands = np.array([row[3] for row in rows])
    kept = slice(0, len(rows), EVERY)
    n = len(rows[kept])
    return FlightLog(
        name="flight",
        t=EVERY * DT * np.arange(n),
        position=states[kept, 0:3],
        velocity=states[kept, 3:6],
        quaternion=states[kept, 6:10],
        body_rates=states[kept, 10:13],
        specific_force=force[kept],
        motor_commands=asked[kept],
        rotor_speeds=None,
        rate_setpoints=commands[kept, :3],
        thrust_setpoint=commands[kept, 3],
        throttle=None,
        battery=None,
        pieces=(slice(0, n),),
        remarks=(),
    )


def noisy(log, seed=0):
    """Return the log with the noise of its sensors."""
    rng = np.random.default_rng(seed)
    signals = {name: getattr(log, name) for name in NOISE}
    return replace(
        log, **{name: s + NOISE[name] * rng.standard_normal(s.shape) for name, s in signals.items()}
    )
