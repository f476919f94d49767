"""Convert a run to an MCAP file, which Foxglove and Rerun play.

Messages are protobuf, because Rerun shows poses and transforms only in this encoding. Times are
nanoseconds since the start of the flight. The world frame is ENU with z up; the vehicle's frame has
x forward, y left and z up.

| topic | message | when |
|---|---|---|
| /tf | foxglove.FrameTransform from `world` to `drone` | every control step |
| /pose | foxglove.PoseInFrame, the true pose | every control step |
| /estimate | foxglove.PoseInFrame, the estimated pose | every control step of a run with sensors |
| /command | quadsim.Command: t, wx, wy, wz [rad/s], thrust [m/s^2] | every control step |
| /telemetry | quadsim.Telemetry: the columns of the telemetry | every control step |
| /event | quadsim.Event: the columns of events.csv | every event |
| /log | foxglove.Log: the event as text | every event |
| /path | foxglove.PosesInFrame, the whole flown path | at the start |
| /course | foxglove.SceneUpdate: gates with their numbers, obstacles | at the start |
| /gates | foxglove.PosesInFrame, x along the passage, as Rerun shows no scene | at the start |
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from quadsim.course import Course, Gate
from quadsim.course.obstacles import Box, Obstacle
from quadsim.files.extras import imported
from quadsim.palette import FRAME, HIT, NEXT
from quadsim.racing.events import Event
from quadsim.record.run import COUNTS, CRASHES, RecordedRun, columns_of, flown_by
from quadsim.record.run_format import CSV_COLUMNS, event_row
from quadsim.rotation import from_euler, from_yaw, without_jumps

# Names of the world's frame and of the vehicle's
WORLD = "world"
DRONE = "drone"
# Columns of the telemetry that make a pose
POSITION = ("px", "py", "pz")
QUATERNION = ("qw", "qx", "qy", "qz")
# Width of lines [m], and height of a gate's number [m]
LINE_WIDTH = 0.05
TEXT_HEIGHT = 0.4
# Order of Gate.corners that goes around the opening
AROUND = [0, 1, 3, 2]
# Columns of an event that are not numbers with a fraction
EVENT_TYPES = {"kind": "string", "gate": "int64", "lap": "int64", "obstacle": "int64"}
NANOSECONDS = 1_000_000_000


class Message(NamedTuple):
    """A message of an MCAP file."""

    # Time since the start of the flight [ns]
    time: int
    topic: str
    # A protobuf message
    content: Any


def mcap_bytes(run: RecordedRun) -> bytes:
    """Return a run as the content of an MCAP file.

    The metadata record `run` has course, vehicle, sampler, seed, outcome, lap times and digest.

    Raises:
        ModuleNotFoundError: the packages of the extra `mcap` are not installed.
    """
    writer_module = imported("mcap_protobuf.writer", "mcap-protobuf-support", "mcap")
    data = io.BytesIO()
    # Kept by time, as viewers read files from their start to their end
    messages = sorted(_messages(run), key=lambda message: message.time)
    with writer_module.Writer(data) as writer:
        writer.add_metadata("run", _metadata(run))
        for message in messages:
            writer.write_message(
                message.topic, message.content, log_time=message.time, publish_time=message.time
            )
    return data.getvalue()


def nanoseconds(t: float) -> int:
    """Return a time [s] in whole nanoseconds."""
    return round(t * NANOSECONDS)


def _metadata(run: RecordedRun) -> dict[str, str]:
    spec = run.spec
    facts = {
        "course": run.course_name,
        "vehicle": spec["vehicle"]["name"],
        "sampler": flown_by(spec),
        "preset": spec["preset"],
        "seed": spec["seed"],
        "outcome": run.outcome,
        "laps": run.laps,
        "digest": run.digest(),
    }
    return {
        name: value if isinstance(value, str) else json.dumps(value)
        for name, value in facts.items()
    }


def _messages(run: RecordedRun) -> Iterator[Message]:
    """Yield the messages of all topics, one topic after the other."""
    schemas = _Schemas()
    course = run.course
    yield Message(0, "/course", schemas.scene(course))
    yield Message(0, "/gates", schemas.gates(course))
    yield Message(0, "/path", schemas.path(run))
    yield from _of_steps(run, schemas)
    yield from _of_events(run, schemas)


def _attitudes(x: Mapping[str, np.ndarray], names: Sequence[str]) -> list[list[float]]:
    """Return the attitudes in named columns, with continuous signs.  (frames, 4)"""
    return without_jumps(np.column_stack([x[name] for name in names])).tolist()


def _of_steps(run: RecordedRun, schemas: _Schemas) -> Iterator[Message]:
    """Yield the messages of each control step."""
    x = run.telemetry
    columns = columns_of(run.spec)
    types = {name: "int64" if name in COUNTS else "double" for name in columns}
    telemetry = message_class("Telemetry", types)
    command = message_class("Command", dict.fromkeys(("t", "wx", "wy", "wz", "thrust"), "double"))
    has_estimate = "est_px" in columns
    rows = zip(*(x[name].tolist() for name in columns), strict=True)
    # Viewers interpolate between two poses
    attitudes = _attitudes(x, QUATERNION)
    estimates = _attitudes(
        x, [f"est_{name}" for name in QUATERNION] if has_estimate else QUATERNION
    )
    for values, quaternion, estimated in zip(rows, attitudes, estimates, strict=True):
        row = dict(zip(columns, values, strict=True))
        time = nanoseconds(row["t"])
        position = [row[name] for name in POSITION]
        yield Message(time, "/tf", schemas.transform(time, position, quaternion))
        yield Message(time, "/pose", schemas.pose_in_frame(time, position, quaternion))
        if has_estimate:
            position = [row[f"est_{name}"] for name in POSITION]
            yield Message(time, "/estimate", schemas.pose_in_frame(time, position, estimated))
        commanded = command(
            t=row["t"],
            wx=row["wx_cmd"],
            wy=row["wy_cmd"],
            wz=row["wz_cmd"],
            thrust=row["a_cmd"],
        )
        yield Message(time, "/command", commanded)
        yield Message(time, "/telemetry", telemetry(**row))


def _of_events(run: RecordedRun, schemas: _Schemas) -> Iterator[Message]:
    """Yield the messages of each event."""
    types = {name: EVENT_TYPES.get(name, "double") for name in CSV_COLUMNS}
    event_class = message_class("Event", types)
    for event in run.events:
        time = nanoseconds(event.t)
        yield Message(time, "/event", event_class(**event_row(event)))
        yield Message(time, "/log", schemas.log(time, event))


def message_class(name: str, types: Mapping[str, str]) -> Any:
    """Return a protobuf message of the package `quadsim`, made from a table of its fields.

    Args:
        name: the message's name.
        types: the type of each field by its name: double, int64 or string.
    """
    descriptor_pb2 = imported("google.protobuf.descriptor_pb2", "mcap-protobuf-support", "mcap")
    pool_module = imported("google.protobuf.descriptor_pool", "mcap-protobuf-support", "mcap")
    factory = imported("google.protobuf.message_factory", "mcap-protobuf-support", "mcap")
    field = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(
        name=f"quadsim/{name}.proto", package="quadsim", syntax="proto3"
    )
    message = file.message_type.add(name=name)
    for number, (field_name, kind) in enumerate(types.items(), start=1):
        message.field.add(
            name=field_name,
            number=number,
            type=field.Type.Value(f"TYPE_{kind.upper()}"),
            label=field.LABEL_OPTIONAL,
        )
    pool = pool_module.DescriptorPool()
    pool.Add(file)
    return factory.GetMessageClass(pool.FindMessageTypeByName(f"quadsim.{name}"))


class _Schemas:
    """Messages of Foxglove's well-known schemas, which viewers recognise by their names."""

    def __init__(self) -> None:
        # google.protobuf.timestamp_pb2 comes with the package of the schemas
        self._timestamp = imported(
            "google.protobuf.timestamp_pb2", "mcap-protobuf-support", "mcap"
        ).Timestamp

    def _new(self, schema: str, **fields: Any) -> Any:
        """Return a message with these fields."""
        module = imported(
            f"foxglove_schemas_protobuf.{schema}_pb2", "foxglove-schemas-protobuf", "mcap"
        )
        return getattr(module, schema)(**fields)

    def _stamp(self, time: int) -> Any:
        """Return a time [ns] as a protobuf time stamp."""
        seconds, nanos = divmod(time, NANOSECONDS)
        return self._timestamp(seconds=seconds, nanos=nanos)

    def _point(self, position: Sequence[float]) -> Any:
        x, y, z = map(float, position)
        return self._new("Point3", x=x, y=y, z=z)

    def _vector(self, vector: Sequence[float]) -> Any:
        x, y, z = map(float, vector)
        return self._new("Vector3", x=x, y=y, z=z)

    def _quaternion(self, wxyz: Sequence[float]) -> Any:
        w, x, y, z = map(float, wxyz)
        return self._new("Quaternion", x=x, y=y, z=z, w=w)

    def _pose(self, position: Sequence[float], wxyz: Sequence[float] = (1.0, 0.0, 0.0, 0.0)) -> Any:
        return self._new(
            "Pose", position=self._vector(position), orientation=self._quaternion(wxyz)
        )

    def _colour(self, hexadecimal: str) -> Any:
        """Return a colour from #rrggbb."""
        red, green, blue = (int(hexadecimal[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
        return self._new("Color", r=red, g=green, b=blue, a=1.0)

    def transform(self, time: int, position: Sequence[float], wxyz: Sequence[float]) -> Any:
        """Return the pose of the vehicle's frame in the world."""
        return self._new(
            "FrameTransform",
            timestamp=self._stamp(time),
            parent_frame_id=WORLD,
            child_frame_id=DRONE,
            translation=self._vector(position),
            rotation=self._quaternion(wxyz),
        )

    def pose_in_frame(self, time: int, position: Sequence[float], wxyz: Sequence[float]) -> Any:
        """Return a pose in the world."""
        pose = self._pose(position, wxyz)
        return self._new("PoseInFrame", timestamp=self._stamp(time), frame_id=WORLD, pose=pose)

    def path(self, run: RecordedRun) -> Any:
        """Return the poses of all control steps."""
        x = run.telemetry
        positions = np.column_stack([x[name] for name in POSITION])
        quaternions = _attitudes(x, QUATERNION)
        return self._poses([self._pose(p, q) for p, q in zip(positions, quaternions, strict=True)])

    def gates(self, course: Course) -> Any:
        """Return the centres of the gates, x along the passage."""
        return self._poses(
            [
                self._pose(gate.position, from_euler(gate.yaw, gate.pitch, gate.roll))
                for gate in course.gates
            ]
        )

    def _poses(self, poses: list[Any]) -> Any:
        return self._new("PosesInFrame", timestamp=self._stamp(0), frame_id=WORLD, poses=poses)

    def log(self, time: int, event: Event) -> Any:
        """Return an event as text: an error if it ends a flight, else information."""
        where = f" {event.place}" if event.place else ""
        text = f"lap {event.lap}: {event.kind.replace('_', ' ')}{where} at {event.speed:.1f} m/s"
        level = "ERROR" if event.kind in CRASHES else "INFO"
        message = self._new("Log", timestamp=self._stamp(time), message=text, name="referee")
        message.level = type(message).Level.Value(level)
        return message

    def scene(self, course: Course) -> Any:
        """Return the gates and the obstacles of a course."""
        gates = [self._gate(number, gate) for number, gate in enumerate(course.gates, start=1)]
        obstacles = [
            self._obstacle(number, obstacle)
            for number, obstacle in enumerate(course.obstacles, start=1)
        ]
        return self._new("SceneUpdate", entities=[*gates, *obstacles])

    def _entity(self, name: str, **primitives: Any) -> Any:
        return self._new(
            "SceneEntity", timestamp=self._stamp(0), frame_id=WORLD, id=name, **primitives
        )

    def _gate(self, number: int, gate: Gate) -> Any:
        """Return a gate as the borders of its opening and frame, with its number above them."""
        opening = self._loop(gate.corners()[AROUND], NEXT)
        corners = gate.corners(gate.frame_width)[AROUND]
        frame = self._loop(corners, FRAME)
        x, y, _ = gate.position
        top = (x, y, float(corners[:, 2].max()) + TEXT_HEIGHT)
        text = self._new(
            "TextPrimitive",
            pose=self._pose(top),
            billboard=True,
            font_size=TEXT_HEIGHT,
            color=self._colour(FRAME),
            text=str(number),
        )
        return self._entity(f"gate {number}", lines=[opening, frame], texts=[text])

    def _loop(self, corners: np.ndarray, colour: str) -> Any:
        """Return a closed line through corners (n, 3)."""
        line = self._new(
            "LinePrimitive",
            pose=self._pose((0.0, 0.0, 0.0)),
            thickness=LINE_WIDTH,
            points=[self._point(corner) for corner in corners],
            color=self._colour(colour),
        )
        line.type = type(line).Type.Value("LINE_LOOP")
        return line

    def _obstacle(self, number: int, obstacle: Obstacle) -> Any:
        """Return an obstacle as a cube or as a cylinder."""
        name = f"obstacle {number}"
        colour = self._colour(HIT)
        if isinstance(obstacle, Box):
            pose = self._pose(obstacle.centre, from_yaw(obstacle.yaw))
            size = self._vector(obstacle.size)
            cube = self._new("CubePrimitive", pose=pose, size=size, color=colour)
            return self._entity(name, cubes=[cube])
        width = 2.0 * obstacle.radius
        cylinder = self._new(
            "CylinderPrimitive",
            pose=self._pose(obstacle.centre),
            size=self._vector((width, width, obstacle.height)),
            bottom_scale=1.0,
            top_scale=1.0,
            color=colour,
        )
        return self._entity(name, cylinders=[cylinder])
