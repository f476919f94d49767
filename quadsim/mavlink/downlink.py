"""Downlink sends the client the state of the vehicle and the race, the track, and pictures."""

from __future__ import annotations

from math import isfinite

from quadsim.config.spec import Spec
from quadsim.dynamics.quadrotor import State
from quadsim.mavlink.clock import SimulatorClock
from quadsim.mavlink.messages import (
    ActuatorOutputStatus,
    Attitude,
    Collision,
    GlobalPositionInt,
    Heartbeat,
    HomePosition,
    LocalPositionNed,
    Odometry,
    Statustext,
    SysStatus,
)
from quadsim.mavlink.pictures import Eye, chunks, jpeg
from quadsim.mavlink.race_data import NO_RACE, RaceStatus, status_message, track_messages
from quadsim.mavlink.senses import Senses
from quadsim.mavlink.served import Served
from quadsim.mavlink.telemetry import (
    Motion,
    attitude_message,
    global_position_message,
    home_message,
    imu_message,
    motors_message,
    odometry_message,
    position_message,
)
from quadsim.mavlink.udp_link import UdpLink
from quadsim.physics.plant_state import PlantState
from quadsim.racing.events import Event, Frame
from quadsim.sensing import Sensing
from quadsim.sensing.barometer import washed_height
from quadsim.sensing.timing import Ticks

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
    # Those that follow are ours: MAVSDK and ground stations wait for them.
    "SYS_STATUS": 1.0,
    "GLOBAL_POSITION_INT": 10.0,
    "HOME_POSITION": 1.0,
}
# Messages whose rate a client may change, by number; the largest rate [Hz]
CHANGEABLE = {
    kind.ID: kind.NAME
    for kind in (
        ActuatorOutputStatus,
        Attitude,
        GlobalPositionInt,
        HomePosition,
        LocalPositionNed,
        Odometry,
        SysStatus,
    )
}
FASTEST = 400.0
# HEARTBEAT: a quadrotor, a generic autopilot, flags of base_mode
QUADROTOR = 2
GENERIC = 0
CUSTOM_MODE = 1
ARMED = 128
# MAV_SYS_STATUS_SENSOR: gyroscope, accelerometer, magnetometer, pressure, satellites (here: the
# position), control of rates, attitude, yaw, height and position, motors, checks before arming
INERTIAL = 0x1 | 0x2 | 0x8 | 0x400 | 0x800 | 0x8000 | 0x10000000
PLACED = 0x4 | 0x20 | 0x1000 | 0x2000 | 0x4000
# A geofence that is not there is well: MAVProxy would say that it is breached
NO_FENCE = 0x100000
# COLLISION.id
GATE = 1001
ENVIRONMENT = 1002
TOUCHES = ("hit", "ground", "bounds")
INFO = 6  # MAV_SEVERITY_INFO


class Downlink:
    """Sends the client what is due at each state of a flight.

    Attributes:
        resets: races that the client has ended, of which ODOMETRY has the count.
        skipped: pictures that were left out, as the flight lagged behind the wall clock.
        custom_mode: mode that the client has set last, which HEARTBEAT tells; it changes no flight.
        tells_poses: whether the client is sent poses, of the vehicle and of the gates.
        has_countdown: whether the client is told a start in the future.

    Args:
        link: the link to the client.
        clock: time since the simulator's start.
        spec: specification of the flights.
        sensing: sensors whose measurements are sent; None: the truth.
        served: how the flights are served.
    """

    def __init__(
        self,
        link: UdpLink,
        clock: SimulatorClock,
        spec: Spec,
        sensing: Sensing | None,
        served: Served,
    ):
        self.resets = 0
        self.skipped = 0
        self.custom_mode = 0
        measures_pose = sensing is None or sensing.pose is not None
        self.tells_poses = served.round == "first" and measures_pose
        self.has_countdown = served.countdown is not None
        self._link = link
        self._clock = clock
        self._spec = spec
        self._served = served
        self._eye = Eye(spec.flown_course, served.camera) if served.camera else None
        self._transfers = 0
        self._pictures = 0
        self._rates = dict(RATES)
        self._ticks: dict[str, Ticks] = {}
        self._status = NO_RACE

    @property
    def is_compiled(self) -> bool:
        """Whether pictures can be drawn without compiling code first, or none are sent."""
        return self._eye is None or self._eye.is_compiled

    def prepare(self) -> None:
        """Draw a picture that is not sent, so that compiling holds up no message."""
        if self._eye is not None:
            self._eye.picture((0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))

    def begin(self, status: RaceStatus) -> None:
        """Begin a flight, or the wait for one, at t = 0; `status` is the state of its race."""
        self._ticks = {name: Ticks(rate) for name, rate in self._rates.items()}
        if self._eye is not None:
            self._ticks["picture"] = Ticks(self._eye.rate)
        self._status = status

    def set_interval(self, number: float, interval: float) -> bool:
        """Change the rate of a message; return whether it can be changed.

        In lock step, in which messages decide when a setpoint is awaited, none can.

        Args:
            number: the message's number.
            interval: time between two messages [us]; 0: the usual time, -1: it is not sent.
        """
        name = CHANGEABLE.get(int(number)) if isfinite(number) else None
        fastest = 1e6 / FASTEST
        if name is None or self._served.lock_step:
            return False
        if interval == 0.0:
            self._rates[name] = RATES[name]
        elif interval == -1.0:
            self._rates[name] = 0.0
        elif interval >= fastest:
            self._rates[name] = 1e6 / interval
        else:
            return False
        self._ticks[name] = Ticks(self._rates[name])
        return True

    def tell_start(self, boot: float | None) -> None:
        """Tell in the race status when the race is to start.

        Args:
            boot: time since the simulator's start [s]; None: it is not known.
        """
        start_ms = -1 if boot is None else round(1e3 * boot)
        self._status = self._status._replace(start_boot_ms=start_ms)

    def send_state(self, state: PlantState[State], senses: Senses, is_armed: bool) -> int:
        """Send the messages that are due at a state of the vehicle.

        Args:
            state: the state.
            senses: what is known of the vehicle's motion.
            is_armed: whether the vehicle is armed.

        Returns:
            The number of these messages that want a setpoint each, in lock step.
        """
        senses.observe(state)
        t = state.t
        boot = self._clock.boot
        send = self._link.send

        # The vehicle and the race.
        if self._due("HEARTBEAT", t):
            mode = CUSTOM_MODE | (ARMED if is_armed else 0)
            send(Heartbeat(QUADROTOR, GENERIC, mode, self.custom_mode))
        if self._due("SYS_STATUS", t):
            well = INERTIAL | (PLACED if self.tells_poses else 0)
            send(SysStatus(well, well, well | NO_FENCE))
        if self._due("STATUS", t):
            send(status_message(self._status._replace(boot_ms=round(1e3 * boot))))
        if self._due("TRACK", t):
            self.send_track()
        if self._eye is not None and self._due("picture", t):
            self._send_picture(self._eye, state)

        # The sensors and the motors.
        samples = senses.samples()
        height = senses.height
        if height is None:
            height = washed_height(state.x, self._served.baro_wash)
        for sample in samples:
            send(imu_message(sample, height, boot - t + sample.t))
        if self._due("ACTUATOR_OUTPUT_STATUS", t):
            send(motors_message(state.x.thrust, self._spec.vehicle, boot))

        # The motion, if it is known.
        motion = senses.motion
        if motion is None or not self.tells_poses:
            return len(samples)
        return self._send_motion(motion, t)

    def _send_motion(self, motion: Motion, t: float) -> int:
        """Send the messages of the motion that are due at t [s]; return the number of ODOMETRY."""
        send = self._link.send
        boot = self._clock.boot
        if self._due("ATTITUDE", t):
            send(attitude_message(motion, boot))
        if self._due("LOCAL_POSITION_NED", t):
            send(position_message(motion, boot))
        if self._due("GLOBAL_POSITION_INT", t):
            send(global_position_message(motion, boot))
        home = self.home_position()
        if home is not None and self._due("HOME_POSITION", t):
            send(home)
        if not self._due("ODOMETRY", t):
            return 0
        send(odometry_message(motion, boot, self.resets))
        return 1

    def home_position(self) -> HomePosition | None:
        """Return the place of the start, None if the client is told no poses."""
        return home_message(self._spec.flown_course.start.position) if self.tells_poses else None

    def _due(self, name: str, t: float) -> bool:
        """Return whether a message is due at t [s]."""
        return self._rates.get(name, 1.0) > 0.0 and self._ticks[name].due(t)

    def send_track(self) -> None:
        """Send the track."""
        self._transfers += 1
        transfer = self._transfers % 2**16
        for message in track_messages(self._spec.course, transfer, self.tells_poses):
            self._link.send(message)

    def _send_picture(self, eye: Eye, state: PlantState[State]) -> None:
        """Send a picture, unless the flight lags behind the wall clock by more than its period."""
        if not self._served.lock_step and self._clock.behind() > 1.0 / eye.rate:
            self.skipped += 1
            return
        file = jpeg(eye.picture(state.x.position, state.x.attitude))
        self._link.send_picture(chunks(file, self._pictures, self._clock.boot))
        self._pictures += 1

    def send_race(self, frame: Frame) -> None:
        """Send what has happened in the race since the last frame."""
        send = self._link.send
        for event in frame.events:
            if event.kind in TOUCHES:
                send(_collision(event, self._spec.vehicle.mass))

        passes = [event for event in frame.events if event.kind == "pass"]
        status = self._status._replace(
            boot_ms=round(1e3 * self._clock.boot), active_gate=max(frame.gate - 1, 0)
        )
        if passes:
            status = status._replace(last_gate_ns=round(1e9 * passes[-1].t))
        if frame.outcome == "finished":
            status = status._replace(finish_ns=status.last_gate_ns)
        self._status = status
        if passes or frame.outcome:
            send(status_message(status))
        if frame.outcome:
            text = f"race {frame.outcome} after {frame.t:.3f} s"
            send(Statustext(INFO, text.encode()))


def _collision(event: Event, mass: float) -> Collision:
    """Return COLLISION for a touch; its last field is the momentum, as sample clients read it.

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
