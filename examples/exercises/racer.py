"""A racer by MPPI in plain NumPy, without the three functions that the exercises ask for.

`Racer` simulates the samples, one array entry for each, and scores them. A subclass says how noise
is drawn, how costs become weights, and which temperature is used: exercises.py asks for them.
"""

import numpy as np

from quadsim.dynamics.quadrotor import State

G = 9.81  # [m/s^2]
DT = 0.05  # [s] of a step of the plan
HORIZON = 24  # steps, 1.2 s
SAMPLES = 256
PERIOD = 0.01  # [s] between two calls of control
LAG = 0.06  # [s] of the body rates
SIGMA = np.array((1.5, 1.5, 0.2, 5.0))  # [rad/s, rad/s, rad/s, m/s^2]
LOW = np.array((-8.0, -8.0, -2.0, 1.0))  # limits of the controls
HIGH = np.array((8.0, 8.0, 2.0, 35.0))
REST = np.array((0.0, 0.0, 0.0, G))  # the control that hovers
CRASH = 200.0  # [m] that each step after a crash costs


class Racer:
    """A controller for `race fly --controller`: control(x) returns body rates and thrust."""

    iterations = 1  # of each call

    def __init__(self, spec):
        gates = spec.course.gates
        self.centres = np.array([gate.position for gate in gates])  # (N, 3) [m]
        self.along = np.array([gate.axes[0] for gate in gates])  # (N, 3), the way through
        self.passed = 0
        self.before = None
        self.plan = np.tile(REST, (HORIZON, 1))
        self.age = 0.0  # [s] since the plan was moved on by a whole step
        self.rng = np.random.default_rng(spec.seed)

    # What the exercises ask for

    def noise(self, rng, shape):
        """Return perturbations (samples, steps, controls), in standard deviations."""
        raise NotImplementedError

    def weights(self, costs, temperature):
        """Return weights (samples,) that sum to one."""
        raise NotImplementedError

    def temperature(self, costs):
        """Return the temperature, in metres, as the cost is a distance."""
        return 1.0

    # The planner

    def control(self, x):
        """Return body rates [rad/s] and thrust over mass [m/s^2] for the state x."""
        self._count_gates(x[:3])
        for _ in range(self.iterations):
            z = SIGMA * self.noise(self.rng, (SAMPLES, HORIZON, 4))
            z[0] = 0.0  # the plan itself
            v = np.clip(self.plan + z, LOW, HIGH)
            costs = self.rollouts(x, v)
            w = self.weights(costs, self.temperature(costs))
            self.plan = self.plan + np.einsum("m,mtc->tc", w, v - self.plan)
        first = self.plan[0].copy()
        self.age += PERIOD
        if self.age >= DT:
            self.age -= DT
            self.plan = np.concatenate([self.plan[1:], REST[None]])
        return tuple(np.clip(first, LOW, HIGH))

    def rollouts(self, x, v):
        """Return the mean distance to the finish [m] of each control sequence v, (samples,)."""
        state = State(*x)
        p = np.tile(x[0:3], (SAMPLES, 1))
        velocity = np.tile(x[3:6], (SAMPLES, 1))
        q = np.tile(state.attitude, (SAMPLES, 1))
        omega = np.tile(x[10:13], (SAMPLES, 1))
        gate = np.full(SAMPLES, self.passed)
        crashed = np.zeros(SAMPLES, bool)
        total = np.zeros(SAMPLES)
        for t in range(HORIZON):
            omega = omega + (v[:, t, :3] - omega) * (1.0 - np.exp(-DT / LAG))
            q = turned(q, omega * DT)
            acceleration = body_z(q) * v[:, t, 3:] - np.array((0.0, 0.0, G)) - 0.2 * velocity
            velocity = velocity + acceleration * DT
            p_next = p + velocity * DT
            gate, hit = self._through_gates(gate, p, p_next)
            crashed |= hit | (p_next[:, 2] < 0.3)
            p = p_next
            total += self.to_go(gate, p) + CRASH * crashed
        return total / HORIZON

    def to_go(self, gate, p):
        """Return the distance to the next gate, less 15 m for every gate passed."""
        centre = self.centres[gate % len(self.centres)]
        return np.linalg.norm(centre - p, axis=1) - 15.0 * (gate - self.passed)

    def _through_gates(self, gate, p, p_next):
        """Return each sample's next gate, and whether it has missed the opening in between."""
        centre, along = (array[gate % len(self.centres)] for array in (self.centres, self.along))
        behind = np.einsum("mi,mi->m", p - centre, along) < 0.0
        ahead = np.einsum("mi,mi->m", p_next - centre, along) >= 0.0
        crossed = behind & ahead
        off = np.linalg.norm(p_next - centre - along * _dot(p_next - centre, along), axis=1)
        inside = off < 0.5
        return gate + (crossed & inside), crossed & ~inside & (off < 3.0)

    def _count_gates(self, p):
        if self.before is not None:
            gate, _ = self._through_gates(np.array([self.passed]), self.before[None], p[None])
            self.passed = int(gate[0])
        self.before = np.array(p)


def _dot(a, b):
    return np.einsum("mi,mi->m", a, b)[:, None]


def turned(q, angle):
    """Return quaternions (samples, 4) after a turn by small angles about the body's axes [rad]."""
    w, x, y, z = q.T
    a, b, c = 0.5 * angle.T
    moved = np.stack(
        [
            w - x * a - y * b - z * c,
            x + w * a + y * c - z * b,
            y + w * b - x * c + z * a,
            z + w * c + x * b - y * a,
        ],
        axis=1,
    )
    return moved / np.linalg.norm(moved, axis=1, keepdims=True)


def body_z(q):
    """Return the direction of the thrust in the world, (samples, 3)."""
    w, x, y, z = q.T
    return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
