"""The simulator for a client over MAVLink: it waits for a client, flies its race, and tells all.

The vehicle stands at the start until the client arms it; then the race is on. A flight is the loop
of every other flight, quadsim.racing.flight: each control period takes up the command that came
last. Physics steps follow the wall clock, or the client: in lock step the time stands still after
each ODOMETRY (HIGHRES_IMU where that is not sent) until a command has come.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, Literal

import numpy as np

from quadsim.config.spec import Spec
from quadsim.mavlink.messages import (
    Collision,
    CommandAck,
    CommandLong,
    DataTransmissionHandshake,
    Heartbeat,
    Message,
    SetAttitudeTarget,
    SetPositionTargetLocalNed,
    Statustext,
    Timesync,
)
from quadsim.mavlink.pictures import Eye, chunks, jpeg
from quadsim.mavlink.race_data import RaceStatus, status_message, track_messages
from quadsim.mavlink.senses import Senses
from quadsim.mavlink.setpoints import (
    Rates,
    Setpoint,
    attitude_setpoint,
    control_of,
    path_setpoint,
)
from quadsim.mavlink.telemetry import (
    Motion,
    attitude_message,
    imu_message,
    motors_message,
    odometry_message,
    position_message,
)
from quadsim.mavlink.wire import Wire
from quadsim.physics.plant_state import PlantState
from quadsim.racing.events import Event, Frame
from quadsim.racing.flight import (
    FlightParts,
    PhysicsStep,
    Planning,
    exact_navigation,
    flight,
)
from quadsim.sensing import Sensing
from quadsim.sensing.barometer import washed_height
from quadsim.sensing.camera import Camera
from quadsim.sensing.timing import Ticks
from quadsim.vehicle import GRAVITY

# Messages a second [Hz], as teams have counted them at the simulator (click-b8/AI-GrandPrix-)
RATES = {
    "HEARTBEAT": 10.0,
    "ATTITUDE": 114.0,
    "LOCAL_POSITION_NED": 92.0,
    "ODOMETRY": 73.0,
    "ACTUATOR_OUTPUT_STATUS": 92.0,
    "STATUS": 4.0,
    # The simulator sends the track once; teams have lost it, so it comes again and again here.
    "TRACK": 1.0,
}
# Rounds of the virtual contest: in the second one, pose and track are not told
Round = Literal["first", "second"]
# Commands of COMMAND_LONG
ARM = 400
REQUEST_MESSAGE = 512
RESET = 31000
ACCEPTED = 0  # MAV_RESULT
DENIED = 2
UNSUPPORTED = 3
# HEARTBEAT: a quadrotor, a generic autopilot, flags of base_mode
QUADROTOR = 2
GENERIC = 0
CUSTOM_MODE = 1
ARMED = 128
# COLLISION.id
GATE = 1001
ENVIRONMENT = 1002
TOUCHES = ("hit", "ground", "bounds")
INFO = 6  # MAV_SEVERITY_INFO
# [s] In lock step, the time for a command; without one the flight goes on with the last command.
PATIENCE = 1.0
# [s] A race in lock step begins once the client has been quiet for so long, or has not been for
# PATIENCE: it may still answer messages from before the race.
QUIET = 0.1
# [s] Time without a packet of the client, after which a race in lock step is over
SILENCE = 10.0
# [s] A flight that lags further behind the wall clock is slower than that from then on.
LAG = 0.25


@dataclass(frozen=True)
class Served:
    """How a flight is served."""

    client: str = "127.0.0.1"
    port: int = 14550
    camera_port: int = 5600
    camera: Camera | None = None  # None: no pictures
    round: Round = "first"
    lock_step: bool = False
    # by how much the barometer reads low in hover, in proportion to the thrust [m]
    baro_wash: float = 0.0


class MavlinkClient:
    """A Controller: the client at the other end of the link.

    Attributes:
        round, lock_step, baro_wash: as served.
        sensing: the sensors whose measurements the client was sent; None: the truth.
        command: the present command, body rates [rad/s] and thrust [m/s^2]  (4,).
    """

    # hover, which acts until the first command
    rest = np.array([0.0, 0.0, 0.0, GRAVITY])

    def __init__(self, served: Served, sensing: Sensing | None):
        self.round = served.round
        self.lock_step = served.lock_step
        self.baro_wash = served.baro_wash
        self.sensing = sensing
        self.command: np.ndarray = self.rest

    def control(self, estimate: Any, /) -> tuple[np.ndarray, Any]:
        """Return the present command; the estimate is not used."""
        from quadsim.controllers.plan import PlanStats

        return self.command, PlanStats(cost=0.0, ess=0.0, temperature=0.0)


class Server:
    """Serves races of one specification to one client; `close` ends it.

    Attributes:
        sensing: sensors whose measurements are sent; None: the truth.
        wire: the sockets, which count what they send and receive.
        was_reset: whether the client has ended the last race by a reset.
        was_silent: whether the last race ended as no packet came in lock step.
        unanswered: periods in lock step in which no command came within PATIENCE.
        lost: time by which the flights were slower than the wall clock [s].
        skipped: pictures that were left out, as the flight lagged behind the wall clock.

    Args:
        spec: specification of the flights.
        sensing: sensors whose measurements are sent; None: the truth.
        served: how they are served.
    """

    def __init__(self, spec: Spec, sensing: Sensing | None, served: Served):
        self._spec = spec
        self.sensing = sensing
        self._served = served
        self._course = spec.flown_course
        self.wire = Wire(served.client, served.port, served.camera_port)
        self._eye = Eye(self._course, served.camera) if served.camera else None
        # The time since the simulator's start is the wall clock less this [s], but in lock step.
        self._origin = perf_counter()
        self._boot = 0.0
        self._is_armed = False
        self._is_racing = False
        self._asked_for_reset = False
        self.was_reset = False
        self.was_silent = False
        self._resets = 0
        self._transfers = 0
        self._pictures = 0
        self._setpoint: Setpoint | None = None
        # commands that have come, and messages in lock step that want one, since the last wait
        self._commands = 0
        self._wanted = 0
        self._heard = 0.0
        self.unanswered = 0
        self.lost = 0.0
        self.skipped = 0
        self._status = RaceStatus(0, -1, -1, 0, -1)
        self._ticks: dict[str, Ticks] = {}
        self._senses: Senses | None = None

    def close(self) -> None:
        """Free the sockets."""
        self.wire.close()

    # Waiting for a client.

    def wait(self, parts: FlightParts, limit: float | None = None) -> bool:
        """Wait at the start until the client arms the vehicle; return whether it has.

        Args:
            parts: the parts of the race, whose vehicle stands at the start.
            limit: longest time to wait [s]; None: for ever.
        """
        self._begin(parts)
        self._status = RaceStatus(0, -1, -1, 0, -1)
        self._is_armed = False
        self._is_racing = False
        x = parts.plant.state.x
        began = perf_counter()
        self._origin = began - self._boot
        step = 0
        while not self._is_armed:
            t = step * parts.plant.dt
            if limit is not None and t >= limit:
                return False
            self._listen_until(began + t)
            self._boot = perf_counter() - self._origin
            self._tell_state(PlantState(t, x, ()))
            # Steps that were missed are left out: nothing moves.
            step = max(step + 1, int((perf_counter() - began) / parts.plant.dt))
        return True

    # A race.

    def race(self, parts: FlightParts, client: MavlinkClient) -> Iterator[Frame]:
        """Fly a race by the client's commands, and yield its frames.

        It ends as every flight does, or without an outcome if the client resets it, or is silent in
        lock step.

        Args:
            parts: the parts of the race, whose controller is the client.
            client: the controller, which gets the commands.
        """
        plant = parts.plant
        spec = self._spec
        period = spec.planner.mppi.dt
        rest = tuple(client.rest.tolist())
        navigation = exact_navigation(plant.state, parts.referee, rest, period)
        self._begin(parts)
        if self._served.lock_step:
            self._let_answers_pass()
        self._is_racing = True
        self._asked_for_reset = False
        self.was_reset = False
        self.was_silent = False
        self._setpoint = None
        self._commands = 0
        self._wanted = 0
        self._heard = perf_counter()
        starts = self._boot
        self._origin = perf_counter() - starts
        self._status = RaceStatus(round(1e3 * starts), round(1e3 * starts), -1, 0, -1)
        self._tell_state(plant.state)
        # The client has sensors of its own, or the true state.
        parts = replace(parts, navigation=navigation, clock=None)
        for step in flight(parts):
            if isinstance(step, Planning):
                if not self._takes_up_commands():
                    self.was_silent = True
                    return
                if self._setpoint is not None:
                    command = control_of(self._setpoint, plant.state.x, spec.vehicle)
                    client.command = np.array(command)
                step.run()
            elif isinstance(step, PhysicsStep):
                t = plant.state.t + plant.dt
                if not self._served.lock_step:
                    self._keep_pace(starts + t)
                plant.step(step.u)
                self._boot = starts + t
                self._tell_state(plant.state)
            else:
                self._tell_race(step)
                yield step
                if self._asked_for_reset:
                    self._resets += 1
                    self.was_reset = True
                    return

    def _begin(self, parts: FlightParts) -> None:
        """Prepare the telemetry of a flight that begins at t = 0."""
        self._ticks = {name: Ticks(rate) for name, rate in RATES.items()}
        if self._served.camera:
            self._ticks["picture"] = Ticks(self._served.camera.rate)
        self._senses = Senses(self._spec, self.sensing, parts.plant)

    def _takes_up_commands(self) -> bool:
        """Read what the client has sent; in lock step, wait for its command.

        Returns:
            Whether the client is there.
        """
        self._listen_until(0.0)
        if not self._served.lock_step:
            return True
        end = perf_counter() + PATIENCE
        while self._commands < self._wanted and not self._asked_for_reset:
            if perf_counter() >= end:
                self.unanswered += 1
                break
            self._hear(end - perf_counter())
        self._commands = 0
        self._wanted = 0
        return perf_counter() - self._heard < SILENCE

    def _let_answers_pass(self) -> None:
        """Hear what the client has to say of messages from before the race."""
        end = perf_counter() + PATIENCE
        quiet_since = perf_counter()
        while perf_counter() < min(end, quiet_since + QUIET):
            if self._hear(QUIET):
                quiet_since = perf_counter()

    def _keep_pace(self, boot: float) -> None:
        """Wait until the wall clock is at a time since the start, or note that it is far ahead.

        Args:
            boot: time since the simulator's start [s].
        """
        late = perf_counter() - self._origin - boot
        if late > LAG:
            self.lost += late
            self._origin += late
        self._listen_until(self._origin + boot)

    # What the client says.

    def _listen_until(self, end: float) -> None:
        """Hear the client until a time of the wall clock [s]; at least what has come by now."""
        while True:
            left = end - perf_counter()
            self._hear(left)
            if end - perf_counter() <= 0.0:
                return

    def _hear(self, wait: float) -> bool:
        """Act on the messages that have come, and return whether any has.

        Args:
            wait: time to wait for the first one [s].
        """
        messages = self.wire.receive(wait)
        if messages:
            self._heard = perf_counter()
        for message in messages:
            self._act(message)
        return bool(messages)

    def _act(self, message: Message) -> None:
        """Act on a message of the client."""
        match message:
            case SetAttitudeTarget():
                self._take(attitude_setpoint(message, self._spec.vehicle))
            case SetPositionTargetLocalNed():
                self._take(path_setpoint(message))
            case CommandLong():
                result = self._obey(message)
                self.wire.send(CommandAck(message.command, result))
            case Timesync():
                # A client that asks leaves one of the two at 0.
                if not message.ts1:
                    self.wire.send(Timesync(message.tc1, round(1e9 * self._boot)))
                elif not message.tc1:
                    self.wire.send(Timesync(round(1e9 * self._boot), message.ts1))
            case DataTransmissionHandshake():
                self._tell_track()
            case _:
                pass

    def _take(self, setpoint: Setpoint | None) -> None:
        """Take a setpoint; one with numbers that cannot be used changes nothing."""
        self._commands += 1
        if setpoint is None:
            self.wire.received["unusable"] += 1
        elif self._is_armed:
            self._setpoint = setpoint

    def _obey(self, message: CommandLong) -> int:
        """Obey a command, and return its MAV_RESULT."""
        if message.command == ARM:
            self._is_armed = message.param1 > 0.5
            if not self._is_armed and self._is_racing:
                self._setpoint = Rates((0.0, 0.0, 0.0), 0.0)
            return ACCEPTED
        if message.command == RESET:
            self._asked_for_reset = True
            return ACCEPTED
        if message.command == REQUEST_MESSAGE:
            if message.param1 not in (130.0, 131.0):
                return DENIED
            self._tell_track()
            return ACCEPTED
        return UNSUPPORTED

    # What the client is told.

    def _tell_state(self, state: PlantState) -> None:
        """Send the messages that are due at a state of the vehicle."""
        senses = self._senses
        assert senses is not None
        senses.observe(state)
        t = state.t
        send = self.wire.send
        boot = self._boot
        if self._due("HEARTBEAT", t):
            mode = CUSTOM_MODE | (ARMED if self._is_armed else 0)
            send(Heartbeat(QUADROTOR, GENERIC, mode))
        if self._due("STATUS", t):
            send(status_message(self._status._replace(boot_ms=round(1e3 * boot))))
        if self._due("TRACK", t):
            self._tell_track()
        if self._due("picture", t):
            self._tell_picture(state)
        samples = senses.samples()
        height = senses.height
        if height is None:
            height = washed_height(state.x, self._served.baro_wash)
        for sample in samples:
            send(imu_message(sample, height, boot - t + sample.t))
        if self._due("ACTUATOR_OUTPUT_STATUS", t):
            send(motors_message(state.x.thrust, self._spec.vehicle, boot))
        motion = senses.motion
        if motion is None or self._served.round == "second":
            self._wanted += len(samples)
        else:
            self._tell_motion(motion, t)

    def _tell_motion(self, motion: Motion, t: float) -> None:
        """Send the messages of the motion that are due at t [s]."""
        send = self.wire.send
        boot = self._boot
        if self._due("ATTITUDE", t):
            send(attitude_message(motion, boot))
        if self._due("LOCAL_POSITION_NED", t):
            send(position_message(motion, boot))
        if self._due("ODOMETRY", t):
            send(odometry_message(motion, boot, self._resets))
            self._wanted += 1

    def _due(self, name: str, t: float) -> bool:
        """Return whether a message is due at t [s]."""
        ticks = self._ticks.get(name)
        return ticks is not None and ticks.due(t)

    def _tell_track(self) -> None:
        """Send the track."""
        self._transfers += 1
        has_poses = self._served.round == "first"
        transfer = self._transfers % 2**16
        for message in track_messages(self._spec.course, transfer, has_poses):
            self.wire.send(message)

    def _tell_picture(self, state: PlantState) -> None:
        """Send what the camera sees, unless the flight lags behind the wall clock."""
        assert self._eye is not None
        assert self._served.camera is not None
        behind = perf_counter() - self._origin - self._boot
        if not self._served.lock_step and behind > 1.0 / self._served.camera.rate:
            self.skipped += 1
            return
        file = jpeg(self._eye.picture(state.x.position, state.x.attitude))
        self.wire.send_picture(chunks(file, self._pictures, self._boot))
        self._pictures += 1

    def _tell_race(self, frame: Frame) -> None:
        """Send what has happened in the race since the last frame."""
        for event in frame.events:
            if event.kind in TOUCHES:
                self.wire.send(_collision(event, self._spec.vehicle.mass))
        passes = [event for event in frame.events if event.kind == "pass"]
        status = self._status._replace(
            boot_ms=round(1e3 * self._boot), active_gate=max(frame.gate - 1, 0)
        )
        if passes:
            status = status._replace(last_gate_ns=round(1e9 * passes[-1].t))
        if frame.outcome == "finished":
            status = status._replace(finish_ns=status.last_gate_ns)
        self._status = status
        if passes or frame.outcome:
            self.wire.send(status_message(status))
        if frame.outcome:
            text = f"race {frame.outcome} after {frame.t:.3f} s"
            self.wire.send(Statustext(INFO, text.encode()))


def _collision(event: Event, mass: float) -> Collision:
    """Return COLLISION for a touch, with the momentum of the vehicle as the sample client has it.

    Args:
        event: the touch.
        mass: mass of the vehicle [kg].
    """
    return Collision(
        src=0,
        id=GATE if event.gate and event.kind == "hit" else ENVIRONMENT,
        action=0,
        threat_level=2,
        time_to_minimum_delta=0.0,
        altitude_minimum_delta=0.0,
        horizontal_minimum_delta=mass * event.speed,
    )
