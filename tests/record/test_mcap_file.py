"""Claims about MCAP files, which are read back by the format's own library."""

import io
from collections import defaultdict

import numpy as np
import pytest

import quadsim
from quadsim.cli.cli import race
from quadsim.record.mcap_file import mcap_bytes, nanoseconds
from quadsim.record.run_format import event_row
from quadsim.rotation import matrix
from tests.run_cases import two_laps
from tests.small import SHORT

reader = pytest.importorskip("mcap.reader")
decoder = pytest.importorskip("mcap_protobuf.decoder")
pytest.importorskip("foxglove_schemas_protobuf")

AXES = ("px", "py", "pz")
# A course with boxes and cylinders beside its gates
COURSE = "lsy_level2"


def opened(data):
    """Return a reader of an MCAP file."""
    return reader.make_reader(io.BytesIO(data), decoder_factories=[decoder.DecoderFactory()])


def read(data):
    """Return {topic: [(time [ns], schema's name, message)]}."""
    found = defaultdict(list)
    for schema, channel, message, content in opened(data).iter_decoded_messages():
        found[channel.topic].append((message.log_time, schema.name, content))
    return found


def vector(v):
    return [v.x, v.y, v.z]


@pytest.fixture(scope="module")
def run():
    return two_laps(quadsim.Spec.of(COURSE, laps=2).record())


@pytest.fixture(scope="module")
def topics(run):
    return read(mcap_bytes(run))


def test_poses_are_the_states_of_the_telemetry(run, topics):
    x = run.telemetry
    places = np.column_stack([x[name] for name in AXES])
    for topic, of in (("/pose", lambda m: m.pose.position), ("/tf", lambda m: m.translation)):
        found = np.array([vector(of(message)) for _, _, message in topics[topic]])
        assert np.array_equal(found, places)
    times = [time for time, _, _ in topics["/pose"]]
    assert times == [nanoseconds(t) for t in x["t"].tolist()]
    q = topics["/pose"][7][2].pose.orientation
    assert [q.w, q.x, q.y, q.z] == [x[name][7] for name in ("qw", "qx", "qy", "qz")]
    stamp = topics["/pose"][-1][2].timestamp
    assert stamp.seconds * 10**9 + stamp.nanos == times[-1]
    path = np.array([vector(pose.position) for pose in topics["/path"][0][2].poses])
    assert np.array_equal(path, places)


def test_events_are_those_of_the_run(run, topics):
    found = topics["/event"]
    assert [time for time, _, _ in found] == [nanoseconds(event.t) for event in run.events]
    for (_, _, message), event in zip(found, run.events, strict=True):
        for name, value in event_row(event).items():
            assert getattr(message, name) == value
    texts = [message.message for _, _, message in topics["/log"]]
    assert "lap 2: hit gate 2 at 12.3 m/s" in texts
    assert [m.Level.Name(m.level) for _, _, m in topics["/log"]].count("ERROR") == 1


def test_every_column_of_the_telemetry_and_every_command_is_in_it(run, topics):
    for name, column in run.telemetry.items():
        assert [getattr(m, name) for _, _, m in topics["/telemetry"]] == column.tolist()
    thrust = [message.thrust for _, _, message in topics["/command"]]
    assert thrust == run.telemetry["a_cmd"].tolist()


def test_gates_and_obstacles_are_where_the_course_has_them(topics):
    course = quadsim.load_course(COURSE)
    ((_, _, scene),) = topics["/course"]
    by_name = {entity.id: entity for entity in scene.entities}
    assert len(by_name) == len(course.gates) + len(course.obstacles)
    for number, gate in enumerate(course.gates, start=1):
        opening, frame = by_name[f"gate {number}"].lines
        corners = np.array([vector(point) for point in opening.points])
        assert corners.mean(axis=0) == pytest.approx(gate.position)
        # It goes around: no side is a diagonal
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
        assert sorted(sides) == pytest.approx(sorted([*gate.opening, *gate.opening]))
        assert len(frame.points) == 4
    for number, obstacle in enumerate(course.obstacles, start=1):
        entity = by_name[f"obstacle {number}"]
        (solid,) = [*entity.cubes, *entity.cylinders]
        assert vector(solid.pose.position) == pytest.approx(obstacle.centre)
    ((_, _, gates),) = topics["/gates"]
    for pose, gate in zip(gates.poses, course.gates, strict=True):
        q = pose.orientation
        assert matrix((q.w, q.x, q.y, q.z)) == pytest.approx(np.array(gate.rotation))


def test_the_names_are_those_that_viewers_know(topics):
    schemas = {topic: messages[0][1] for topic, messages in topics.items()}
    assert schemas == {
        "/tf": "foxglove.FrameTransform",
        "/pose": "foxglove.PoseInFrame",
        "/command": "quadsim.Command",
        "/telemetry": "quadsim.Telemetry",
        "/event": "quadsim.Event",
        "/log": "foxglove.Log",
        "/path": "foxglove.PosesInFrame",
        "/course": "foxglove.SceneUpdate",
        "/gates": "foxglove.PosesInFrame",
    }


def test_the_file_tells_what_flew(run):
    (metadata,) = opened(mcap_bytes(run)).iter_metadata()
    assert metadata.metadata["course"] == COURSE
    assert metadata.metadata["digest"] == run.digest()


@pytest.mark.compiled
def test_the_estimate_is_in_the_file_of_a_flight_with_sensors():
    sensed = quadsim.fly("figure8", sensing="mocap", **SHORT)
    found = read(mcap_bytes(sensed))["/estimate"]
    places = np.array([vector(message.pose.position) for _, _, message in found])
    x = sensed.telemetry
    assert np.array_equal(places, np.column_stack([x[f"est_{name}"] for name in AXES]))


def test_a_run_without_a_frame_is_a_file_with_its_course():
    empty = quadsim.Run.from_frames(quadsim.Spec.of(COURSE).record(), [])
    assert set(read(mcap_bytes(empty))) == {"/course", "/gates", "/path"}


def test_the_command_writes_the_file_and_the_method_the_same(run, tmp_path, capsys):
    flown = quadsim.Run.of(run)
    folder = flown.save(tmp_path)
    out = tmp_path / "flown.mcap"
    assert race(["export", str(folder), "--mcap", "--out", str(out)]) == 0
    assert capsys.readouterr().out.strip() == str(out)
    assert out.read_bytes() == flown.export(tmp_path / "again.mcap").read_bytes()


def test_two_runs_are_refused_in_one_line(run, tmp_path, capsys):
    folder = str(quadsim.Run.of(run).save(tmp_path))
    assert race(["export", folder, folder, "--mcap", "--out", str(tmp_path / "x.mcap")]) == 2
    assert capsys.readouterr().err == "race export: --mcap: expected one run, got 2\n"
    assert not (tmp_path / "x.mcap").exists()
