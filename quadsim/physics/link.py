"""The link that carries commands to the flight controller: a rate, a latency and losses.

    command -> interpolation -> frame -> lost or not -> latency -> received

A frame carries the command of the instant at which it is sent. With several frames in a control
period, an interpolating link sends commands on a straight line from one command to the next. A
receiver keeps the last command that has arrived.

Losses follow Gilbert's model of a channel (Bell System Technical Journal 39(5), 1960): the channel
is good or bad, frames are lost while it is bad, and it changes from one frame to the next with
fixed probabilities. These follow from the share p of lost frames and the mean length L of a burst:

    bad -> good   1 / L
    good -> bad   p / (L (1 - p))

Losses are independent with L = 1 / (1 - p).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.random import SeedSequence, default_rng

from quadsim.dynamics.quadrotor import Control
from quadsim.physics.faults import SAME, CommandFault
from quadsim.vehicle import GRAVITY

HOVER = Control(wx=0.0, wy=0.0, wz=0.0, thrust=GRAVITY)
# A frame is sent in the step of its instant; tolerance for an earlier step, as a share of a step.
ROUNDING = 1e-6


# Setting of a flight -> its number in a LinkConfig
SETTINGS = {
    "link_hz": "rate",
    "link_latency": "latency",
    "link_loss": "loss",
    "link_burst": "burst",
}


@dataclass(frozen=True)
class LinkConfig:
    """The parameters of a link; the default is a wire that carries a frame in each physics step."""

    rate: float | None = None  # frames a second [Hz]; None: one in each physics step
    latency: float = 0.0  # in addition to the vehicle's latency [s]
    loss: float = 0.0  # share of the frames that are lost
    burst: float | None = None  # mean number of frames lost in a row; None: lost independently

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> LinkConfig:
        """Return the link of a flight's settings `link_hz`, `link_latency` and so on."""
        return cls(**{number: settings[name] for name, number in SETTINGS.items()})

    def __str__(self) -> str:
        """Return a short description, such as "link of 40 Hz losing 10 %"."""
        words = ["link"]
        if self.rate:
            words.append(f"of {self.rate:g} Hz")
        if self.latency:
            words.append(f"late by {1e3 * self.latency:g} ms")
        if self.loss:
            words.append(f"losing {100 * self.loss:g} %")
        if self.burst:
            words.append(f"in bursts of {self.burst:g}")
        return " ".join(words)

    @property
    def period(self) -> float:
        """The time between two frames [s]; 0: a frame in every physics step."""
        return 1.0 / self.rate if self.rate else 0.0

    @property
    def mean_burst(self) -> float:
        """The mean number of frames lost in a row."""
        return self.burst or 1.0 / (1.0 - self.loss)


WIRE = LinkConfig()


def command_latency(vehicle: float, link: float, model: float) -> float:
    """Return the time from a command to its effect, apart from the wait for a frame [s].

    Args:
        vehicle: latency of the vehicle [s].
        link: latency of the link [s].
        model: delay of the rate loop, as the planner's model has it [s].
    """
    return vehicle + link + model


class Received(NamedTuple):
    """The state of the receiver in a physics step."""

    command: Control  # the last command that has arrived
    is_new: bool  # whether a frame has arrived in this step


class FaultyCommands:
    """Commands that arrive late or not at all; the last one that arrived stays in force."""

    def __init__(self, faults: Sequence[CommandFault]):
        """Begin with the command for hovering, which is kept until the first command arrives."""
        self._faults = faults
        self._arrived: tuple[float, ...] = HOVER
        # the commands on their way, each with the time at which it was sent [s]
        self._sent: deque[tuple[float, tuple[float, ...]]] = deque()

    def carried(self, t: float, u: tuple[float, ...]) -> tuple[float, ...]:
        """Return the received command at the time t [s], when u is sent."""
        self._sent.append((t, u))
        delay = sum(fault.delay for fault in self._faults if fault.window.active(t))
        while self._sent and self._sent[0][0] <= t - delay + SAME:
            _, self._arrived = self._sent.popleft()
        if delay == inf:
            self._sent.clear()
        return self._arrived


class CommandNoise:
    """Noise that is added to the commands, drawn anew in each control period."""

    def __init__(self, std: Sequence[float], steps: int, stream: SeedSequence):
        """Begin at t = 0.

        Args:
            std: standard deviation for each command, in the order of Control  (4,).
            steps: physics steps in a control period.
            stream: random stream of the noise.
        """
        self._std = np.array(std)
        self._every = steps
        self._random = default_rng(stream)
        self._steps = 0
        self._noise = [0.0] * len(self._std)

    def added(self, command: Control) -> Control:
        """Return the command of a physics step with noise added to it."""
        if self._steps % self._every == 0:
            self._noise = (self._std * self._random.standard_normal(len(self._std))).tolist()
        self._steps += 1
        return Control(*(u + e for u, e in zip(command, self._noise, strict=True)))


class Link:
    """The link to one vehicle, advanced by one physics step with each command."""

    def __init__(
        self,
        dt: float,
        vehicle_latency: float = 0.0,
        config: LinkConfig = WIRE,
        interpolation: float = 0.0,
        stream: SeedSequence | None = None,
        noise: CommandNoise | None = None,
    ):
        """Begin at t = 0, when the receiver has the command for hovering.

        Args:
            dt: physics step [s].
            vehicle_latency: latency of the vehicle, to which the link's latency is added [s].
            config: numbers of the link.
            interpolation: time of the linear interpolation to a new command, a control period [s];
                0: none.
            stream: random stream of the losses; needed only with losses.
            noise: noise that is added to the commands; None: no noise.
        """
        self._dt = dt
        self._noise = noise
        self._config = config
        self._frame_period = config.period or dt
        self._steps = 0
        self._frames = 0
        self._interpolation = interpolation

        # Linear interpolation: first command, last command, and step of its begin
        self._from = HOVER
        self._goal = HOVER
        self._since = 0
        self._sent = HOVER

        self._on_the_way: deque[Control | None] = deque(
            [None] * round((vehicle_latency + config.latency) / dt)
        )
        self._received = HOVER
        self._random = default_rng(stream) if config.loss else None
        self._is_bad = self._random is not None and self._random.random() < config.loss

    @property
    def frame_steps(self) -> int:
        """The physics steps between two frames, rounded."""
        return max(round(self._frame_period / self._dt), 1)

    def carry(self, command: Control) -> Received:
        """Send a command for one physics step, and return the receiver's state."""
        if self._noise is not None:
            command = self._noise.added(command)
        self._on_the_way.append(self._frame(command))
        self._steps += 1
        arrived = self._on_the_way.popleft()
        if arrived is None:
            return Received(self._received, is_new=False)
        self._received = arrived
        return Received(arrived, is_new=True)

    def _frame(self, command: Control) -> Control | None:
        """Return the command in the frame that is sent in this step, None if no frame is sent."""
        if self._steps * self._dt < self._frames * self._config.period - ROUNDING * self._dt:
            return None
        self._frames += 1
        sent = self._interpolated(command)
        return None if self._is_lost() else sent

    def _interpolated(self, command: Control) -> Control:
        """Return the interpolated command that is sent now."""
        if command != self._goal:
            self._from = self._sent
            self._goal = command
            self._since = self._steps
        # The last frame of a control period carries the given command itself.
        reached = (self._steps - self._since) * self._dt + self._frame_period
        if reached >= self._interpolation - ROUNDING * self._dt:
            self._sent = command
        else:
            share = reached / self._interpolation
            pairs = zip(self._from, command, strict=True)
            self._sent = Control(*(before + share * (goal - before) for before, goal in pairs))
        return self._sent

    def _is_lost(self) -> bool:
        """Return whether the frame that is sent now is lost."""
        if self._random is None:
            return False
        lost = self._is_bad
        p = self._config.loss
        length = self._config.mean_burst
        change = 1.0 / length if lost else p / (length * (1.0 - p))
        if self._random.random() < change:
            self._is_bad = not self._is_bad
        return lost
