"""Prediction of the state at which a control that is planned now takes effect.

The delay is the planning time, the wait for the link's next frame, and the latency of link and
vehicle. The commands during the delay have been given already, so the planner's own model
propagates the state under them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from math import ceil
from typing import NamedTuple

import numpy as np

from quadsim.course import Course
from quadsim.course.opening import crossing, on_passage
from quadsim.dynamics.quadrotor import Control, ModelParams, State, quadrotor
from quadsim.rotation import Vec3

Command = tuple[float, ...]  # (n_u,)

# [s] Instants that differ by less count as equal.
SAME = 1e-6


class Given(NamedTuple):
    """A command, and the time from which it acts [s]."""

    acts: float
    u: Command


class Piece(NamedTuple):
    """An interval of time under one command."""

    # [s]
    duration: float
    u: Command


class Acted(NamedTuple):
    """The commands that acted over an interval: one, or on the wall clock two or more."""

    commands: tuple[Control, ...]
    # share of the interval, which add up to 1
    shares: tuple[float, ...]

    @classmethod
    def of(cls, pieces: Sequence[Piece]) -> Acted:
        """Return the commands of an interval, which is not empty."""
        duration = sum(piece.duration for piece in pieces)
        commands = tuple(Control(*piece.u) for piece in pieces)
        return cls(commands, tuple(piece.duration / duration for piece in pieces))

    @property
    def least_thrust(self) -> float:
        """The least commanded thrust [m/s^2]."""
        return min(u.thrust for u in self.commands)

    @property
    def mean_thrust(self) -> float:
        """The commanded thrust, averaged over time [m/s^2]."""
        return sum(s * u.thrust for s, u in zip(self.shares, self.commands, strict=True))

    @property
    def mean_tilt_rates(self) -> np.ndarray:
        """The commanded roll and pitch rate, averaged over time [rad/s]  (2,)."""
        rates = np.array([u.body_rates[:2] for u in self.commands])
        return np.array(self.shares) @ rates


class Commands:
    """The commands given so far, each acting `latency` [s] after the frame that carries it."""

    def __init__(self, rest: Command, latency: float, frame_period: float = 0.0):
        """Begin without a command.

        Args:
            rest: command that acts until the first given command does  (n_u,).
            latency: time from a frame to the action of its command [s].
            frame_period: time between frames, from t = 0 on [s]; 0: a frame at every instant.
        """
        self.latency = latency
        self._frame_period = frame_period
        self._given: deque[Given] = deque([Given(float("-inf"), rest)])

    def next_frame(self, t: float) -> float:
        """Return the time of the frame that carries a command given at t [s]."""
        if not self._frame_period:
            return t
        return ceil((t - SAME) / self._frame_period) * self._frame_period

    def delay_by(self, more: float) -> None:
        """Let all commands act later by a time [s], those given so far as well."""
        self.latency += more
        self._given = deque(given._replace(acts=given.acts + more) for given in self._given)

    def give(self, t: float, u: Command) -> None:
        """Note that the command u (n_u,) is given at t [s], and forget old commands."""
        self._given.append(Given(self.next_frame(t) + self.latency, u))
        while len(self._given) > 2 and self._given[1].acts < t - 1.0:
            self._given.popleft()

    def mean(self, t0: float, t1: float) -> Command:
        """Return the command between t0 and t1 [s], averaged over time."""
        return mean_command(tuple(self.pieces(t0, t1)))

    def acting(self, t: float) -> Command:
        """Return the command that acts from t [s] on, among the remembered ones."""
        for given in reversed(self._given):
            if given.acts <= t + SAME:
                return given.u
        return self._given[0].u

    def pieces(self, t0: float, t1: float) -> Iterator[Piece]:
        """Yield the intervals from t0 to t1 [s] with a constant command."""
        if t1 <= t0 + SAME:
            return
        # A later command replaces an earlier one that has not been sent yet.
        ends: list[float] = []
        for given in reversed(self._given):
            if given.acts <= t0 + SAME:
                break
            if given.acts < t1 - SAME and given.acts not in ends:
                ends.insert(0, given.acts)
        for end in (*ends, t1):
            yield Piece(end - t0, self.acting(t0))
            t0 = end


def mean_command(pieces: Sequence[Piece]) -> Command:
    """Return the command of an interval, averaged over time; the interval is not empty."""
    if len(pieces) == 1:
        return pieces[0].u
    duration = sum(piece.duration for piece in pieces)
    weighted = [[piece.duration * value for value in piece.u] for piece in pieces]
    return tuple(sum(values) / duration for values in zip(*weighted, strict=True))


def predict(
    x: State, commands: Commands, t0: float, t1: float, model: ModelParams, longest: float
) -> State:
    """Predict the state at t1 from the state x at t0.

    Args:
        x: state at t0.
        commands: commands given until now.
        t0, t1: [s].
        model: the planner's model.
        longest: longest integration step [s].
    """
    for piece in commands.pieces(t0, t1):
        steps = max(1, -int(-(piece.duration - SAME) // longest))
        system = quadrotor(model, piece.duration / steps)
        for _ in range(steps):
            x = system.next(x, piece.u)
    return State._make(map(float, x))


class GateCounter:
    """Counts the gates passed by the estimated path.

    The path passes a gate if it crosses the gate's plane within the frame.
    """

    def __init__(self, course: Course, laps: int):
        """Start before the first gate.

        Args:
            course: the map.
            laps: number of laps, after which no more gates are counted.
        """
        self._map = course
        self._laps = laps
        # position at the last call [m]
        self._before: Vec3 | None = None
        self.passed = 0

    def at(self, x: Sequence[float], course: Course | None = None) -> int:
        """Return the number of gates passed when the vehicle is in the state x.

        The path is the straight line from the position at the last call.

        Args:
            x: state, which begins with the position [m]  (n_x,).
            course: the estimated course; None: the map.
        """
        position = (x[0], x[1], x[2])
        before = self._before
        self._before = position
        gates = (course or self._map).gates
        if before is None or self.passed >= self._laps * len(gates):
            return self.passed
        gate = gates[self.passed % len(gates)]
        crossed = crossing(gate.to_local(before), gate.to_local(position))
        if (
            crossed
            and crossed.forward
            and on_passage(crossed.offset, gate.opening, gate.frame_width)
        ):
            self.passed += 1
        return self.passed
