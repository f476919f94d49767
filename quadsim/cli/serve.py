"""`race serve`: the simulator for a client over MAVLink, in place of a planner."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from contextlib import ExitStack, closing, suppress
from dataclasses import replace
from enum import Enum, auto
from typing import Annotated, Any

from msgspec import Meta

from quadsim.cli.commands import EXIT
from quadsim.cli.flags import CourseName, Given, Help, Json, Switch, flag, names, settings_as_flags
from quadsim.cli.fly import of_planner
from quadsim.cli.report import report, summary
from quadsim.config.build import build, racing_referee
from quadsim.config.competition import load_competition
from quadsim.config.spec import Spec
from quadsim.console import UsageError, complain, emit, emit_json, uninterrupted, width
from quadsim.files.values import SettingError
from quadsim.mavlink.client import MavlinkClient
from quadsim.mavlink.commands import SILENCE, Phase
from quadsim.mavlink.served import Round, Served
from quadsim.mavlink.server import Server
from quadsim.physics.faults import BiasJump, SensorFault
from quadsim.racing.events import NO_PROGRESS_BY_HAND
from quadsim.record.archive import RunFolder, remove_unfinished
from quadsim.record.run import Recorder
from quadsim.sensing import Sensing, load_sensing
from quadsim.sensing.camera import Camera, camera_names, load_camera
from quadsim.sensing.sensing_file import camera_named, sensing_names

Port = Annotated[int, Meta(ge=1, le=65535)]
# Control period [s] without a preset's: the simulator takes commands of less than 100 Hz
PERIOD = 0.01
NO_CAMERA = "none"
# The camera of the virtual qualifier
VIRTUAL = "aigp"
# Settings that say who flies, or what only a planner of ours would use
OF_OUR_OWN = ("preset", "pilot", "controller", "excite", "predict", "deadline_ms", "threads")
OF_SENSING = ("record_sensing", "known_from")


def serve(
    course: CourseName = None,
    /,
    *,
    client: Annotated[
        str, Help("address of the client; any but this machine's own opens the simulator to it")
    ] = "127.0.0.1",
    port: Annotated[Port, Help("UDP port on which the client listens for MAVLink")] = 14550,
    camera_port: Annotated[Port, Help("UDP port on which it listens for pictures")] = 5600,
    camera: Annotated[
        str | None,
        Help(
            "camera of the pictures: a name, a FILE.yaml or a set of sensors with a camera; none"
            " sends no pictures; default: that of --sensing, else of the competition, else aigp",
            completer=names(lambda: (NO_CAMERA, *camera_names(), *sensing_names())),
        ),
    ] = None,
    round_: Annotated[
        Round,
        Help("second: ATTITUDE, LOCAL_POSITION_NED and ODOMETRY are not sent", name="--round"),
    ] = "first",
    lock_step: Annotated[
        bool, Switch("time waits for a command after each ODOMETRY, in place of the wall clock")
    ] = False,
    races: Annotated[
        Annotated[int, Meta(ge=1, le=10**6)], Help("races after which it ends; resets do not count")
    ] = 1,
    countdown: Annotated[
        Annotated[float, Meta(ge=0, le=600)] | None,
        Help(
            "time from the client's first message, or from its reset, to the start of the race,"
            " which RACE_STATUS tells in advance [s]; default: the race starts when the client arms"
        ),
    ] = None,
    baro_wash: Annotated[
        Annotated[float, Meta(ge=0, le=100)],
        Help("by how much the barometer reads low in hover, in proportion to the thrust [m]"),
    ] = 0.0,
    settings: Given = None,
    json: Json = False,
) -> int:
    """Stand in for the AI Grand Prix's simulator: a client flies over MAVLink 2 and UDP.

    It ends after the race, by Ctrl-C, or if no client arms the vehicle within --timeout.

    race serve --competition aigp_physical --sensing perfect

    race serve aigp_physical --vehicle archer --round second --laps 1 --lock-step --camera none
    """
    given = dict(settings or {})
    eyes = _camera(camera, given)
    served = Served(client, port, camera_port, eyes, round_, lock_step, baro_wash, countdown)
    spec, sensing = _asked(course, given, served)
    remove_unfinished(spec.runs_dir)
    limit = float(given["timeout"]) if given.get("timeout") else None

    with settings_as_flags():
        server = Server(spec, sensing, served)
    with closing(server):
        if not json:
            emit(f"{spec.course.name}, vehicle {spec.vehicle.name}: {_address(served)}")
        if not server.downlink.is_compiled:
            complain("race serve: compiling the pictures' code for this machine, once: some 15 s")
        server.downlink.prepare()
        if not json:
            complain("race serve: waits until the client arms the vehicle; Ctrl-C ends it")
        found, code = _races(spec, server, races, limit, json)
        if json:
            emit_json({"races": found, **counted(server)})
    return code


def _races(
    spec: Spec, server: Server, count: int, limit: float | None, json: bool
) -> tuple[list[dict[str, Any]], int]:
    """Serve races; return their results, those of resets not among them, and the exit code.

    Args:
        spec: specification of the races.
        server: serves them.
        count: number of races.
        limit: longest time to wait for a client at each start [s]; None: for ever.
        json: whether reports are not printed.
    """
    found: list[dict[str, Any]] = []
    code = 0
    while len(found) < count:
        with closing(_Race(spec, server)) as race:
            waited = race.waits(limit)
            if waited is Waited.TIMEOUT:
                complain(f"race serve: no client has armed the vehicle within {limit:g} s")
                return found, 1
            if waited is Waited.INTERRUPTED:
                if not found:
                    complain("race serve: no race was flown to its end")
                return found, EXIT["interrupted"]
            outcome = race.flies()
            result = race.stored(json, counted(server))
        phase = server.commands.phase
        if phase is Phase.RESET:
            continue
        found.append(result)
        code = EXIT[outcome]
        if phase is Phase.SILENT:
            what = "setpoint" if spec.clock == "simulated" else "packet"
            complain(f"race serve: no {what} of the client for {SILENCE:g} s: the race has ended")
            return found, 1
        if outcome == "interrupted":
            break
    return found, code


class Waited(Enum):
    """How the wait at the start has ended."""

    ARMED = auto()
    TIMEOUT = auto()  # no client has armed the vehicle in time
    INTERRUPTED = auto()  # by Ctrl-C


class _Race:
    """One race of a server, from the wait for its client to its record."""

    def __init__(self, spec: Spec, server: Server):
        self._spec = spec
        self._server = server
        self._record = spec.record()
        with settings_as_flags():
            referee = racing_referee(spec, stuck_after=NO_PROGRESS_BY_HAND)
            self._parts = build(replace(spec, controller=server.client), referee=referee)
        self._end = ExitStack()
        self._end.enter_context(closing(self._parts.plant))
        self._recorder = Recorder()

    def close(self) -> None:
        """Free the plant."""
        self._end.close()

    def waits(self, limit: float | None) -> Waited:
        """Wait for the client, at most for `limit` [s]; return how the wait has ended."""
        with suppress(KeyboardInterrupt):
            return Waited.ARMED if self._server.wait(self._parts, limit) else Waited.TIMEOUT
        return Waited.INTERRUPTED

    def flies(self) -> str:
        """Fly and record the race, and return its outcome."""
        with suppress(KeyboardInterrupt):
            for frame in self._server.race(self._parts):
                self._recorder.add(frame)
        if not len(self._recorder):
            raise KeyboardInterrupt("race serve: interrupted, nothing to keep")
        return self._recorder.run(self._record).outcome

    def stored(self, json: bool, packets: Mapping[str, Any]) -> dict[str, Any]:
        """Store the race, print its report unless as `json`, and return it."""
        run = self._recorder.run(self._record)
        folder = None
        opening = RunFolder.open(self._spec.runs_dir, self._record)
        with suppress(KeyboardInterrupt), uninterrupted(), opening as opened:
            opened.save(run)
            folder = opened.path
        if not json:
            emit(*report(run, folder, width(), self._spec.runs_dir))
            emit(_lines_of(packets))
        return summary(run, folder, self._spec.runs_dir)


def _camera(name: str | None, given: Mapping[str, Any]) -> Camera | None:
    """Return the camera of the pictures; None: none are sent.

    Args:
        name: a camera, a set of sensors with one, or NO_CAMERA; None: the camera of the sensors
            among the settings, else that of the competition's.
        given: the settings.

    Raises:
        FileError: a file cannot be read.
    """
    if name is not None:
        return None if name == NO_CAMERA else camera_named(name)
    competition = given.get("competition")
    prescribed = load_competition(competition).settings if competition else {}
    for sensing in (given.get("sensing"), prescribed.get("sensing")):
        camera = load_sensing(sensing).corner_camera if sensing else None
        if camera is not None:
            return camera
    return load_camera(VIRTUAL)


def _asked(
    course: str | None, given: dict[str, Any], served: Served
) -> tuple[Spec, Sensing | None]:
    """Return the Spec of the races, and the sensors whose measurements the client is sent.

    Raises:
        UsageError: a flag cannot be used.
        FileError: a file cannot be read.
    """
    for name in given:
        if name in OF_OUR_OWN or (of_planner(name) and name != "dt"):
            raise UsageError(f"{flag(name)}: expected none, as the client flies")
        if name in OF_SENSING:
            raise UsageError(f"{flag(name)}: expected none, as the client has its own estimator")
    if "clock" in given:
        raise UsageError("--clock: expected none: give --lock-step, or fly on the wall clock")
    competition = given.get("competition")
    prescribed = load_competition(competition).settings if competition else {}
    if "dt" not in prescribed:
        given.setdefault("dt", PERIOD)
    with settings_as_flags():
        clock = "simulated" if served.lock_step else "wall"
        # Neither an estimate nor a model of ours is given to the client.
        spec = Spec.of(course, **given, clock=clock, predict=False, adapt=False)
        sensing = spec.sensing
        for fault in spec.faults:
            if isinstance(fault, SensorFault | BiasJump):
                wanted = "expected a fault of the vehicle or of the commands"
                raise SettingError("fault", f"{wanted}, got {fault}")
        # The client estimates the state, and no estimate of ours is recorded.
        return replace(spec, sensing=None, controller=MavlinkClient(served, sensing)), sensing


def counted(server: Server) -> dict[str, Any]:
    """Return what a server has sent, received and left out, as JSON."""
    return {
        "sent": dict(server.link.sent),
        "received": dict(server.link.received),
        "unanswered": server.commands.unanswered,
        "lost": server.clock.lost,
        "skipped": server.downlink.skipped,
    }


def _lines_of(packets: Mapping[str, Any]) -> str:
    """Return what was sent and received in lines of text."""
    lines = []
    for key in ("sent", "received"):
        counts = Counter(packets[key])
        numbers = [f"{name} {count}" for name, count in sorted(counts.items()) if count]
        lines.append(f"{key}: {', '.join(numbers) or 'nothing'}")
    if packets["unanswered"]:
        lines.append(f"periods without a command in lock step: {packets['unanswered']}")
    if packets["lost"]:
        lines.append(f"behind the wall clock: {packets['lost']:.1f} s")
    if packets["skipped"]:
        lines.append(f"pictures left out to keep up: {packets['skipped']}")
    return "\n".join(lines)


def _address(served: Served) -> str:
    """Return where messages and pictures go."""
    text = f"MAVLink to {served.client}:{served.port}"
    if served.camera:
        text += f", pictures to {served.client}:{served.camera_port}"
    return text
