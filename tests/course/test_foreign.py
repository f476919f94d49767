"""Courses of other simulators: each format gets the right axes, or is refused in one line."""

import json
from math import pi

import numpy as np
import pytest

import quadsim
from quadsim.cli.cli import race
from quadsim.course import Cylinder, load_course, parse_course
from quadsim.course.foreign import FORMATS, Reading, convert

LSY = """\
[env.track]
gate_order = [1, -2]
[[env.track.gates]]
pos = [0.5, 0.25, 0.7]
rpy = [0.0, 0.0, -0.78]
[[env.track.gates]]
pos = [1.05, 0.75, 1.2]
rpy = [0.0, 0.0, 3.14159265]
[[env.track.obstacles]]
pos = [0.0, 0.9, 1.55]
[[env.track.drones]]
pos = [-1.5, 0.75, 0.01]
rpy = [0.0, 0.0, 0.0]
[env.track.safety_limits]
pos_limit_low = [-2.5, -1.5, -1e-3]
pos_limit_high = [2.5, 1.5, 2.0]
"""
# As Python prints poses of AirSim: north, east, down
AIRSIM = """\
Gate1_3: <Pose> {   'orientation': <Quaternionr> {   'w_val': 0.7071068, 'x_val': 0.0,
    'y_val': 0.0, 'z_val': 0.7071068}, 'position': <Vector3r> {   'x_val': -10.0,
    'y_val': 20.0, 'z_val': -2.5}}
Gate0: <Pose> {   'orientation': <Quaternionr> {   'w_val': 1.0, 'x_val': 0.0,
    'y_val': 0.0, 'z_val': 0.0}, 'position': <Vector3r> {   'x_val': 0.0,
    'y_val': 10.0, 'z_val': -2.0}}
"""
AIRSIM_JSON = json.dumps(
    [
        {
            "position": {"x_val": 0.0, "y_val": 10.0, "z_val": -2.0},
            "orientation": {"w_val": 1.0, "x_val": 0.0, "y_val": 0.0, "z_val": 0.0},
            "scale": 0.5,
        }
    ]
)
FLIGHTGOGGLES = """\
flightgoggles_uav_dynamics:
  init_pose: [0.3, 52.0, 2.5, 0.0, 0.0, -0.707, 0.707]
gate_names: ['Gate2', 'Gate9']
Gate9:
  nominal_location: [[-6.4, -12, 4.2], [-8.2, -12, 4.2], [-6.4, -12, 2.3], [-8.2, -12, 2.3]]
  perturbation_bound: [0.0, 0.0, 2.0]
Gate2:
  nominal_location: [[0.8, 27.9, 4.1], [3.8, 27.9, 4.1], [3.8, 27.9, 0.9], [0.8, 27.9, 0.9]]
"""
UZH = """\
start_pos: [-5.0, -4.5, 3.6]
gates:
  Gate1:
    position: [-0.9, -1.27, 3.48]
    rotation: [0.7071068, 0, 0, 0.7071068]
    scale: [0.604, 0.1, 0.604]
  Gate10:
    position: [9.27, -3.46, 1.17]
    rotation: [ 0.8910065, 0, 0, -0.4539905]
    scale: [0.604, 0.1, 0.604]
  Gate2:
    position: [9.09, 6.26, 1.08]
    rotation: [0.7071068, 0, 0, 0.7071068]
    scale: [0.604, 0.1, 0.604]
  N: 3
"""
TABLE = "name,x,y,z,yaw_deg\na,0,5,-1.5,0\nb,5,10,-1.5,90\n"
TEXTS = {
    "lsy": LSY,
    "airsim": AIRSIM,
    "flightgoggles": FLIGHTGOGGLES,
    "uzh": UZH,
    "csv": "x,y,z,yaw_deg,opening\n0,5,1.5,0,1.5\n5,10,1.5,90,1.5\n",
}


@pytest.fixture
def file(tmp_path):
    """Return a function that writes a text and returns the file's path."""

    def write(text, name="track.txt"):
        path = tmp_path / name
        path.write_text(text)
        return str(path)

    return write


def yaws(course):
    return [round(np.degrees(gate.yaw), 3) for gate in course.gates]


def test_every_format_has_a_text_here():
    assert set(TEXTS) == set(FORMATS)


@pytest.mark.parametrize("kind", TEXTS)
def test_what_is_converted_is_a_course_file(file, tmp_path, kind):
    course = quadsim.convert_course(file(TEXTS[kind]), kind)
    course.to_yaml(tmp_path / "out.yaml")
    again = load_course(tmp_path / "out.yaml")
    assert (again.gates, again.start, again.bounds) == (course.gates, course.start, course.bounds)


def test_a_level_of_lsy_is_in_radians_and_has_poles_and_limits(file):
    course = quadsim.convert_course(file(LSY), "lsy")
    assert yaws(course) == [-44.691, 0.0]  # gate 2 is flown the other way
    assert course.gates[0].opening == (0.4, 0.4)
    assert course.gates[0].frame_width == 0.16
    assert course.start == quadsim.Start((-1.5, 0.75, 0.01), 0.0)
    assert course.bounds == ((-2.5, 2.5), (-1.5, 1.5), (-0.001, 2.0))
    (pole,) = course.obstacles
    assert isinstance(pole, Cylinder)
    assert (pole.base, pole.radius, pole.height) == ((0.0, 0.9, 0.0), 0.015, 1.55)


def test_gates_of_airsim_are_north_east_down_and_passed_along_y(file):
    """x = E, y = N, z = -D; the y axis of an unturned gate leads east."""
    course = quadsim.convert_course(file(AIRSIM), "airsim")
    assert [gate.position for gate in course.gates] == [(10.0, 0.0, 2.0), (20.0, -10.0, 2.5)]
    assert yaws(course) == [0.0, -90.0]
    assert course.gates[0].opening == (1.6, 1.6)
    small = quadsim.convert_course(file(AIRSIM_JSON), "airsim")
    assert small.gates[0].opening == (0.8, 0.8)


def test_corners_of_flightgoggles_are_passed_along_the_way(file):
    course = quadsim.convert_course(file(FLIGHTGOGGLES), "flightgoggles")
    assert yaws(course) == [-90.0, -90.0]
    assert [gate.opening for gate in course.gates] == [(3.0, 3.2), (1.8, 1.9)]
    assert course.gates[1].position == (-7.3, -12.0, 3.25)
    assert course.start.position == (0.3, 52.0, 2.5)
    back = quadsim.convert_course(file(FLIGHTGOGGLES), "flightgoggles", gates=("Gate2", "-Gate9"))
    assert yaws(back) == [-90.0, 90.0]


def test_a_tilted_gate_of_flightgoggles_keeps_its_tilt(file):
    gate = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]])
    c, s = np.cos(0.2), np.sin(0.2)
    about_y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    corners = (gate @ about_y.T + [0.0, 5.0, 3.0]).round(6).tolist()
    text = f"G1: {{nominal_location: {corners}}}\nG2: {{nominal_location: {corners}}}\n"
    course = quadsim.convert_course(file(text), "flightgoggles", gates=("G1",), start=(0, 0, 3, 90))
    (found,) = course.gates
    np.testing.assert_allclose(sorted(found.corners().tolist()), sorted(corners), atol=1e-4)
    assert round(np.degrees(found.yaw), 3) in (90.0, -90.0)


@pytest.mark.parametrize(
    ("turn", "axis"),
    [(0.0, "x"), (180.0, "-x"), (90.0, "-y"), (-90.0, "y")],
)
def test_the_passage_of_a_track_of_uzh_is_the_axis_that_fits_the_way(file, turn, axis):
    """Its files differ: -y in SplitS.yaml, -x in AlphaPilot.yaml, x in that of marl-racing."""
    angles = [0.0, 80.0, 150.0]
    gates = "".join(
        f"  Gate{k}: {{position: [{x}, {y}, 2], rpy: [0, 0, {angle + turn}], size: [1, 1, 1.5]}}\n"
        for k, ((x, y), angle) in enumerate(zip([(0, 0), (9, 4), (5, 12)], angles, strict=True), 1)
    )
    text = f"gates:\n{gates}start_pos: [-5, 0, 2]\n"
    found = convert(file(text), "uzh", Reading(angles="deg"))
    assert yaws(found.course) == angles
    assert found.notes[0].startswith(f"passage: the gates' {axis} axis")


def test_gates_of_uzh_are_ordered_by_number_and_sized_by_scale(file):
    course = quadsim.convert_course(file(UZH), "uzh")
    assert [gate.position[1] for gate in course.gates] == [-1.27, 6.26, -3.46]
    assert yaws(course) == [0.0, 0.0, -144.0]
    assert course.gates[0].opening == (1.5, 1.5)


def test_the_tracks_that_come_with_the_project_are_found_again(file):
    """split_s_swift was converted by hand from track.yaml of marl-racing, in this form."""
    known = load_course("split_s_swift")
    gates = "".join(
        f"  Gate{k}: {{position: {list(gate.position)}, size: [0.4, 1.5, 1.5], rotation:"
        f" [{np.cos(gate.yaw / 2):.7f}, 0, 0, {np.sin(gate.yaw / 2):.7f}]}}\n"
        for k, gate in enumerate(known.gates, 1)
    )
    start = "start_pos: [-5.0, 4.7, 0.61]\nstart_attitude: [0.9238795, 0, 0, -0.3826834]\n"
    box = "world_box: [-10.0, -8.0, 0.05, 14.0, 9.0, 6.0]\nloop: yes\n"
    course = quadsim.convert_course(file(f"gates:\n{gates}{start}{box}"), "uzh")
    assert [gate.position for gate in course.gates] == [gate.position for gate in known.gates]
    for found, wanted in zip(course.gates, known.gates, strict=True):
        turn = (found.yaw - wanted.yaw + pi) % (2 * pi) - pi
        assert abs(turn) < 1e-5
    assert course.bounds == known.bounds
    assert course.loop


def test_a_table_is_read_in_any_axes_and_units(file):
    in_metres = quadsim.convert_course(file(TABLE), "csv", frame="ned", opening=(1.5, 1.2))
    assert [gate.position for gate in in_metres.gates] == [(5.0, 0.0, 1.5), (10.0, 5.0, 1.5)]
    assert yaws(in_metres) == [90.0, 0.0]  # 90 - heading
    assert in_metres.gates[0].opening == (1.5, 1.2)
    cm = "x;y;z;yaw\n0;500;-150;0\n500;1000;-150;1.5707963\n"
    settings = {"frame": "ned", "unit": "cm", "angles": "rad", "opening": (1.5, 1.2)}
    assert quadsim.convert_course(file(cm), "csv", **settings).gates == in_metres.gates
    turned = (
        "x\ty\tz\tqw\tqx\tqy\tqz\n0\t5\t-1.5\t1\t0\t0\t0\n5\t10\t-1.5\t.7071068\t0\t0\t.7071068\n"
    )
    quaternions = quadsim.convert_course(file(turned), "csv", frame="ned", opening=(1.5, 1.2))
    assert yaws(quaternions) == [90.0, 0.0]


def test_pitch_and_roll_survive_the_change_of_axes(file):
    """A pitch is up in north-east-down, and down in east-north-up."""
    up = "x,y,z,yaw_deg,pitch_deg,roll_deg,opening\n0,0,-5,0,20,0,1.5\n0,9,-9,90,0,10,1.5\n"
    course = quadsim.convert_course(file(up), "csv", frame="ned")
    first, second = course.gates
    assert np.degrees([first.yaw, first.pitch]).round(4).tolist() == [90.0, -20.0]
    assert np.degrees([second.yaw, second.roll]).round(4).tolist() == [0.0, 10.0]


def test_bounds_that_leave_out_a_gate_are_left_out_and_that_is_said(file):
    text = LSY.replace("pos = [1.05, 0.75, 1.2]", "pos = [2.45, 0.75, 1.2]")
    found = convert(file(text), "lsy", Reading())
    assert any(note.startswith("bounds: left out, as gates[1]") for note in found.notes)
    assert found.course.bounds[0][1] > 10.0


def test_another_axis_that_fits_the_way_better_is_named(file):
    text = TEXTS["csv"].replace(",0,1.5\n", ",180,1.5\n").replace(",90,", ",-90,")
    found = convert(file(text), "csv", Reading())
    assert any("-x axis fits the way better" in note for note in found.notes)


@pytest.mark.parametrize(
    ("kind", "text", "settings", "said"),
    [
        ("lsy", "[env]\nid = 1\n", {}, "track.txt: env.track: missing, expected track, got 'id'"),
        ("lsy", "[env\n", {}, "track.txt: not TOML: "),
        (
            "lsy",
            LSY.replace("gate_order", "randomize = true\ngate_order"),
            {},
            "track.txt: env.track.randomize: expected a level with its places in the file, got one"
            " that draws them: fly it by race fly --competition lsy_level3",
        ),
        ("lsy", LSY.replace("1.2]", "'1.2']"), {}, "env.track.gates[1].pos[2]: expected a number"),
        ("lsy", LSY.replace("[1, -2]", "[1, 7]"), {}, "gates: no gate '7'"),
        (
            "airsim",
            AIRSIM.replace("10.0", "nan"),
            {},
            "Gate0.position.y_val: expected a number from",
        ),
        ("airsim", "[]", {}, "track.txt: expected one gate or more, got none"),
        (
            "airsim",
            AIRSIM.replace("0.7071068", "0.9"),
            {},
            "expected a quaternion of length 1, got",
        ),
        ("flightgoggles", "a: 1\n", {}, "expected gates with nominal_location"),
        ("flightgoggles", FLIGHTGOGGLES.replace("-6.4", "-7.9", 1), {}, "corners of a rectangle"),
        ("uzh", "gates: 3\n", {}, "gates: expected a mapping or a list, got 3.0"),
        ("uzh", UZH.replace("rotation", "turn"), {}, "gates.Gate1.rotation: missing, expected"),
        ("uzh", UZH.replace("0.1, 0.604]", "0.1]", 1), {}, "scale: expected 3 numbers (x, y, z)"),
        ("uzh", UZH.replace("3.48", "-3.48"), {}, "as a course, gates[0].position: expected an"),
        ("csv", "0,5,1.5,0\n", {}, "track.txt:1: expected a header with x, y, z"),
        ("csv", "x,y,z,yaw\n0,5,1.5,0\n", {}, "yaw: expected the column yaw_deg or yaw_rad"),
        ("csv", "x,y,z,yaw_deg\n0,5,1.5,0\n", {}, "expected an opening: the file has none"),
        ("csv", "x,y,z\n0,5,1.5\n", {}, "track.txt:2: expected a direction: yaw_deg, yaw_rad"),
        ("csv", "x,y,z,yaw_deg\n0,5,high,0\n", {}, "track.txt:2: z: expected a number"),
        ("csv", "x,y,z,yaw_deg\n0,5,0\n", {}, "track.txt:2: expected 4 cells, as the header"),
        ("csv", TABLE, {"opening": (1.5, 1.5)}, "other axes (frame) or an offset may be right"),
        ("csv", TEXTS["csv"], {"gates": ("9",)}, "no gate '9'"),
    ],
)
def test_a_wrong_file_is_one_line(file, kind, text, settings, said):
    with pytest.raises(quadsim.FileError) as error:
        quadsim.convert_course(file(text), kind, **settings)
    line = str(error.value)
    assert "\n" not in line
    assert said in line


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"unit": "inch"}, "unit: expected 'cm' or 'ft' or 'm'"),
        ({"frame": "up"}, "frame: expected 'enu' or 'ned'"),
        ({"opening": (1.0, 1.0, 1.0)}, r"opening: expected 2 numbers \[m\]"),
        ({"opening": (1.0, -1.0)}, r"opening: expected 2 numbers \[m\] > 0"),
        ({"frames": "ned"}, "frames: no such setting of a conversion, did you mean 'frame'"),
    ],
)
def test_a_wrong_setting_is_one_line(file, settings, said):
    with pytest.raises(quadsim.SettingError, match=rf"^{said}"):
        quadsim.convert_course(file(TEXTS["csv"]), "csv", **settings)


def test_the_command_writes_a_course_and_says_what_it_assumed(file, tmp_path, capsys):
    out = tmp_path / "mine.yaml"
    argv = ["convert", file(UZH), "--from", "uzh", "--out", str(out)]
    assert race(argv) == 0
    shown = capsys.readouterr()
    assert "3 gates" in shown.out
    assert "passage: the gates' -y axis" in shown.err
    assert race(["check", str(out)]) == 0
    assert race(argv) == 2  # never over another file
    assert "expected a new file" in capsys.readouterr().err


def test_one_number_is_a_square_opening(file, capsys):
    course = quadsim.convert_course(file(TABLE), "csv", frame="ned", opening=1.2)
    assert course.gates[0].opening == (1.2, 1.2)
    assert (
        race(["convert", file(TABLE), "--from", "csv", "--frame", "ned", "--opening", "1.2"]) == 0
    )
    assert "opening: [1.2, 1.2]" in capsys.readouterr().out


def test_the_command_prints_the_course(file, capsys):
    command = ["convert", file(TABLE), "--from", "csv", "--frame", "ned", "--opening", "1.5", "1.5"]
    assert race(command) == 0
    text = capsys.readouterr().out
    assert len(parse_course(text, "out.yaml").gates) == 2


def test_angles_that_look_like_radians_are_remarked_on(file, capsys):
    text = "opening: [1, 1]\nstart: {position: [-4, 0, 2], yaw_deg: 0}\ngates:\n"
    gates = "".join(
        f"  - {{position: [{6 * k}, 0, 2], yaw_deg: {angle}}}\n"
        for k, angle in enumerate((-0.78, 2.35, 3.14))
    )
    path = file(text + gates, "radians.yaml")
    assert race(["check", path]) == 0
    assert "looks like radians, expected degrees, got -0.78, 2.35, 3.14" in capsys.readouterr().err
    for name in quadsim.courses():
        race(["check", name])
    assert capsys.readouterr().err == ""
