"""The simulator for a client over MAVLink: it waits for a client, and the client flies its race.

The vehicle stands at the start until the client arms it; then the race is on. A flight is the loop
of every other flight, quadsim.racing.flight: in each control period the last setpoint of the client
is flown. Physics steps follow the wall clock, or the client: in lock step the time stands still
after each ODOMETRY (HIGHRES_IMU if that is not sent) until a setpoint has come.

UdpLink receives the messages of the client, and Commands obeys them: a setpoint becomes the law of
MavlinkClient, the controller. Downlink sends the client its messages.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from time import perf_counter

from quadsim.config.spec import Spec
from quadsim.mavlink.client import MavlinkClient
from quadsim.mavlink.clock import SimulatorClock
from quadsim.mavlink.commands import Commands, Phase
from quadsim.mavlink.downlink import Downlink
from quadsim.mavlink.race_data import NO_RACE
from quadsim.mavlink.senses import Senses
from quadsim.mavlink.served import Served
from quadsim.mavlink.udp_link import UdpLink
from quadsim.physics.plant_state import PlantState
from quadsim.racing.events import Frame
from quadsim.racing.flight import (
    FlightParts,
    PhysicsStep,
    Planning,
    exact_navigation,
    flight,
    rest_of,
)
from quadsim.sensing import Sensing


class Server:
    """Serves races of one specification to one client; `close` ends it.

    Attributes:
        sensing: sensors whose measurements are sent; None: the truth.
        client: the controller of the races.
        link: the link to the client, which counts what is sent and received.
        clock: time since the simulator's start.
        downlink: what the client is sent.
        commands: what the client asks for, and the phase of the race.

    Args:
        spec: specification of the flights.
        sensing: sensors whose measurements are sent; None: the truth.
        served: how they are served.
    """

    def __init__(self, spec: Spec, sensing: Sensing | None, served: Served):
        self._spec = spec
        self._lock_step = served.lock_step
        self._countdown = served.countdown
        self.sensing = sensing
        self.client = MavlinkClient(served, sensing)
        self.link = UdpLink(served.client, served.port, served.camera_port)
        self.clock = SimulatorClock()
        self.downlink = Downlink(self.link, self.clock, spec, sensing, served)
        self.commands = Commands(self.link, self.client, self.downlink, self.clock, spec.vehicle)

    def close(self) -> None:
        """Free the socket."""
        self.link.close()

    def wait(self, parts: FlightParts, limit: float | None = None) -> bool:
        """Wait at the start until the client arms the vehicle; return whether it has.

        With a countdown, wait until it is over, too.

        Args:
            parts: the parts of the race, whose vehicle stands at the start.
            limit: longest time to wait [s]; None: for ever.
        """
        dt = parts.plant.dt
        x = parts.plant.state.x
        senses = Senses(self._spec, self.sensing, parts.plant)
        self.downlink.begin(NO_RACE)
        self.commands.begin_start()
        self.clock.go_on()
        began = self.clock.wall(self.clock.boot)
        step = 0
        while not self._may_start():
            t = step * dt
            if limit is not None and t >= limit:
                return False
            self.commands.listen_until(began + t)
            self.clock.follow_wall()
            self.downlink.tell_start(self._start())
            self._send_state(PlantState(t, x, ()), senses)
            # Steps that were missed are left out: nothing moves.
            step = max(step + 1, int((perf_counter() - began) / dt))
        return True

    def _start(self) -> float | None:
        """Return when the countdown ends, since the simulator's start [s]; None without one."""
        begins = self.commands.counts_from
        if self._countdown is None or begins is None:
            return None
        return begins + self._countdown

    def _may_start(self) -> bool:
        """Return whether the vehicle is armed, and no countdown is on."""
        if not self.commands.is_armed:
            return False
        start = self._start()
        return start is None or self.clock.boot >= start

    def race(self, parts: FlightParts) -> Iterator[Frame]:
        """Fly a race by the client's setpoints, and yield its frames.

        It ends as every flight does, or without an outcome if the client resets it or is silent;
        `commands.phase` tells.

        Args:
            parts: the parts of the race, whose controller is the client.
        """
        plant = parts.plant
        senses = Senses(self._spec, self.sensing, plant)
        if self._lock_step:
            self.commands.let_answers_pass()
        starts = self.clock.boot
        starts_ms = round(1e3 * starts)
        self.downlink.begin(NO_RACE._replace(boot_ms=starts_ms, start_boot_ms=starts_ms))
        self.commands.begin_race()
        self.clock.go_on()
        self._send_state(plant.state, senses)
        for step in flight(self._exact(parts)):
            if isinstance(step, Planning):
                self._hear_client()
                if self.commands.phase is Phase.SILENT:
                    return
                step.run()
            elif isinstance(step, PhysicsStep):
                boot = starts + (plant.state.t + plant.dt)
                if not self._lock_step:
                    self._keep_pace(boot)
                plant.step(step.u)
                self.clock.boot = boot
                self._send_state(plant.state, senses)
            else:
                self.downlink.send_race(step)
                yield step
                if self.commands.phase is Phase.RESET:
                    self.downlink.resets += 1
                    return

    def _exact(self, parts: FlightParts) -> FlightParts:
        """Return the parts with the true state for the controller: the client has the sensors."""
        period = self._spec.planner.mppi.dt
        rest = rest_of(parts.controller)
        navigation = exact_navigation(parts.plant.state, parts.referee, rest, period)
        return replace(parts, navigation=navigation, clock=None)

    def _hear_client(self) -> None:
        """Obey what has come by now; in lock step, wait for the setpoints that are due."""
        self.commands.listen_until(0.0)
        if self._lock_step:
            self.commands.await_setpoint()

    def _keep_pace(self, boot: float) -> None:
        """Hear the client until the wall clock has come to a time of the simulator [s]."""
        self.clock.note_lag(boot)
        self.commands.listen_until(self.clock.wall(boot))

    def _send_state(self, state: PlantState, senses: Senses) -> None:
        """Send the messages that are due at a state of the vehicle."""
        self.commands.wanted += self.downlink.send_state(state, senses, self.commands.is_armed)
