"""The planner's estimate: the state when its control acts, the gates passed by then, no truth."""

from contextlib import closing
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import quadsim
from quadsim.config.build import build, flight_frames
from quadsim.config.build_navigation import navigation_of
from quadsim.config.spec import Spec
from quadsim.controllers.costs.race_targets import GATE_STDS, GateTarget
from quadsim.course import EstimatedGate, load_course
from quadsim.course.frames import frames
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import Control, ModelParams, State
from quadsim.files.strict_yaml import FileError
from quadsim.physics.domain_randomization import Displacement, displaced
from quadsim.physics.plant import RigidPlant
from quadsim.record.run import RecordedRun
from quadsim.record.run_format import read_npz, write_npz
from quadsim.report.estimate_metrics import estimate_errors, sensing_numbers
from quadsim.sensing import load_sensing, parse_sensing, sensing_names
from quadsim.sensing.estimation.estimator import Estimator
from quadsim.sensing.estimation.prediction import (
    Commands,
    GateCounter,
    Piece,
    mean_command,
    predict,
)
from quadsim.sensing.estimation.vehicle_learner import Acted, VehicleLearner
from quadsim.sensing.navigation import CourseEstimate, TrueState
from quadsim.sensing.sensing_file import SENSORS
from quadsim.vehicle import load_vehicle
from tests.small import SMALL

SWIFT = load_vehicle("swift")
REST = (0.0, 0.0, 0.0, 9.81)
START = np.zeros(17)
FLIGHT = {**SMALL, "laps": 1, "randomize": 1.0}


def test_commands_act_one_after_the_other_and_late():
    commands = Commands(REST, 0.04)
    for k in range(5):
        commands.give(0.01 * k, (float(k), 0.0, 0.0, 10.0))
    assert commands.acting(0.039) == REST
    assert commands.acting(0.04)[0] == 0.0
    pieces = list(commands.pieces(0.035, 0.075))
    assert [u[0] for _, u in pieces] == [0.0, 0.0, 1.0, 2.0, 3.0]
    assert [d for d, _ in pieces] == pytest.approx([0.005, 0.01, 0.01, 0.01, 0.005])
    assert list(commands.pieces(0.05, 0.05)) == []
    assert mean_command(pieces)[0] == pytest.approx((0.01 * (1 + 2) + 0.005 * 3) / 0.04)


def test_the_predicted_state_is_where_the_vehicle_then_is():
    """The plant, with 40 ms of latency, 40 ms later; the state of now is ten times as far off."""
    vehicle, commands = replace(SWIFT, latency=0.04), Commands(REST, 0.04)
    plant = RigidPlant(load_course("split_s_swift"), vehicle)
    ahead, off, late = {}, [], []
    for k in range(40):
        u = (3.0 * np.sin(0.3 * k), 2.0 * np.cos(0.2 * k), 0.5, 25.0)
        x, t = plant.state.x, plant.state.t
        ahead[k + 4] = predict(x, commands, t, t + 0.04, ModelParams.of(vehicle), 0.01), x
        commands.give(t, u)
        if k in ahead:
            predicted, before = ahead[k]
            off.append(np.linalg.norm(np.subtract(predicted, x)[:6]))
            late.append(np.linalg.norm(np.subtract(before, x)[:6]))
        for _ in range(4):
            plant.step(u)
    assert len(off) == 36
    assert np.mean(off) < 0.1 * np.mean(late)


def test_the_model_is_learnt_from_the_time_that_has_passed():
    """Plans of 12.5 ms with a period of 10: taken for 10 ms, every acceleration would be a quarter
    too large."""
    model, plant = ModelParams.of(SWIFT), RigidPlant(load_course("split_s_swift"), SWIFT)
    learner, mistaken = (VehicleLearner.for_exact_states(model, 0.01) for _ in range(2))
    known, periods = TrueState(plant.state, 0.01, learner), 0
    for k in range(40):
        u = Control(1.0 * np.sin(0.3 * k), 1.0 * np.cos(0.2 * k), 0.0, 25.0)
        known.now(plant.state.t, (Piece(0.0125, u),), periods)
        before = State(*plant.state.x)
        for _ in range(5):
            known.watch(plant.step(u))
        mistaken.learn_from_states(before, State(*plant.state.x), Acted((u,), (1.0,)), 0.01)
        periods = 1
    assert learner.model.thrust_gain == pytest.approx(1.0, abs=0.01)
    assert mistaken.model.thrust_gain > 1.05


def test_gates_are_counted_by_the_estimated_path():
    course = load_course("split_s_swift")
    gate = course.gates[0]
    along = np.array(gate.axes[0])
    before, behind = (tuple((np.array(gate.position) + s * along).tolist()) for s in (-0.5, 0.5))
    counter = GateCounter(course, laps=1)
    assert [counter.at(p) for p in (before, behind, before, behind)] == [0, 1, 1, 1]
    beside = tuple((np.array(before) + 2.0 * np.array(gate.axes[1])).tolist())
    missed = GateCounter(course, laps=1)
    assert [missed.at(p) for p in (beside, tuple(np.add(beside, along)))] == [0, 0]


def test_gates_are_counted_where_they_are_estimated_to_stand():
    """A gate 5 m farther along is not passed where the map has it, and is passed there."""
    course = load_course("split_s_swift")
    gate = course.gates[0]
    along = np.array(gate.axes[0])
    moved = replace(gate, position=tuple((np.array(gate.position) + 5.0 * along).tolist()))
    estimated = replace(course, gates=(moved, *course.gates[1:]))
    path = [tuple((np.array(gate.position) + s * along).tolist()) for s in (-0.5, 0.5, 4.5, 5.5)]
    by_map, by_estimate = GateCounter(course, laps=1), GateCounter(course, laps=1)
    assert [by_map.at(p) for p in path] == [0, 1, 1, 1]
    assert [by_estimate.at(p, estimated) for p in path] == [0, 0, 0, 1]


def test_gates_are_moved_by_the_seed_within_the_size():
    course = load_course("split_s_swift")
    one, same, other = (
        displaced(course, np.random.SeedSequence(s), Displacement(0.15)) for s in (1, 1, 2)
    )
    assert one == same != other
    moves = np.subtract([g.position for g in one.gates], [g.position for g in course.gates])
    assert 0.05 < abs(moves[:, :2]).max() <= 0.15
    assert not moves[:, 2].any()


@pytest.mark.compiled
@pytest.mark.parametrize("moved", [0.15, 0.0])
def test_the_planner_keeps_farther_from_a_gate_whose_place_is_uncertain(moved):
    """Seen from the vehicle, which does not know where it is either."""
    spec = Spec.of("split_s_swift", sensing="gates", displace_gates=moved, **FLIGHT)
    parts = build(spec)
    parts.plant.close()
    controller = parts.controller.planner
    margin = first_target(controller).margin
    estimator = Estimator(spec.sensing, frames(spec.course.gates), spec.course.start, 0.0, moved)
    course, state = CourseEstimate(spec.course), estimator.state
    controller.use_estimates(Estimate(0.0, START, course=course.updated(state)))
    target = first_target(controller)
    first, free = target.margin, target.free_y
    assert first == pytest.approx(min(margin + GATE_STDS * state.gate_std(7)[0], 0.7 * free))
    assert first > 2 * margin
    assert course.updated(state) is course.updated(state), (
        "nothing has moved: the same course, the same cost"
    )
    certain = course.updated(replace(state, P=1e-8 * state.P))
    controller.use_estimates(Estimate(0.0, START, course=certain))
    assert first_target(controller).margin == pytest.approx(margin, abs=1e-3)


def first_target(planner):
    """Return the row of the first gate, without the value of the course."""
    return GateTarget(*planner.cost.targets[0][: len(GateTarget._fields)])


@pytest.mark.compiled
def test_the_estimate_has_the_sensed_places_of_gates():
    spec = Spec.of("split_s_swift", sensing="gates", displace_gates=0.15, **FLIGHT)
    parts = build(spec)
    with closing(parts.plant):
        estimate = parts.navigation.estimate(0.0)
    assert estimate.course is not None
    assert all(isinstance(gate, EstimatedGate) and gate.std > 0.0 for gate in estimate.course.gates)
    assert estimate.model is not None, (
        "and what has been learnt of the vehicle, which the preset race adapts to"
    )


@pytest.mark.compiled
def test_exact_knowledge_is_the_true_state_and_the_referees_count():
    """A flight without sensors and latency is flown, and recorded, as it was before there were
    any."""
    spec = Spec.of("split_s_swift", **FLIGHT)
    plant = build(spec).plant
    plant.close()
    assert (spec.sensing, spec.displace_gates) == (None, 0.0)
    at_once = navigation_of(spec, plant, SimpleNamespace(passed=3), REST)
    estimate = at_once.estimate(0.0)
    assert (tuple(estimate.x), estimate.target, estimate.course) == (plant.state.x, 3, None)
    assert at_once.record(plant.state) == ()
    assert at_once.corners is None


@pytest.mark.compiled
@pytest.mark.parametrize("change", [{"vehicle": "swift_40ms"}, {"clock": "wall"}])
def test_where_commands_act_late_the_state_is_predicted_and_gates_are_counted_on_board(change):
    """By latency, or by the planner's own time on the wall clock."""
    spec = Spec.of("split_s_swift", **FLIGHT | change)
    plant = build(spec).plant
    counted = SimpleNamespace(passed=3)
    with closing(plant):
        navigation = navigation_of(spec, plant, counted, REST)
        x = tuple(plant.state.x)
        assert navigation.estimate(0.0).target == 0
        for k in range(1, 11):  # at full thrust, each plan taking 5 ms where time passes
            navigation.commanded(
                0.01 * (k - 1), 0.01 * (k - 1) + 0.005 * ("clock" in change), (0.0, 0.0, 0.0, 39.0)
            )
            estimate = navigation.estimate(0.01 * k)
    assert estimate.x[2] > x[2], (
        "the state that it is given stands still: only the prediction moves"
    )


@pytest.mark.compiled
def test_the_last_frame_is_estimated_at_its_own_time():
    """A flight ends between two control periods; the estimate of the period's beginning would be
    centimetres behind."""
    spec = Spec.of("split_s_swift", sensing="mocap", **FLIGHT | {"timeout": 1.0075})
    run = RecordedRun.from_frames(spec.record(), flight_frames(spec))
    t, off = run.telemetry["t"], np.linalg.norm(estimate_errors(run), axis=1)
    assert t[-1] - t[-2] == pytest.approx(0.0075)
    speed = np.linalg.norm([run.telemetry[name][-1] for name in ("vx", "vy", "vz")])
    assert off[-1] < 0.01 < 0.5 * 0.0075 * speed
    assert run.telemetry["nees"][-1] < 40


def flown_with(name, seed):
    """Return a short flight with this sensing, gates off the map and late commands."""
    settings = FLIGHT | {
        "vehicle": "swift_40ms",
        "sensing": name,
        "displace_gates": 0.15,
        "timeout": 0.25,
    }
    return quadsim.fly("split_s_swift", seed=seed, **settings)


# `pixels_network` is `pixels` with a network, and needs an extra; tests/sensing/test_network.py
@pytest.fixture(scope="module", params=[n for n in sensing_names() if n != "pixels_network"])
def sensed(request):
    """A flight with each sensing of the project, and its name."""
    return request.param, flown_with(request.param, seed=3)


@pytest.mark.compiled
def test_the_same_seed_gives_the_same_bits_and_another_seed_others():
    """With every sensor but a pixel camera, of which it has the other kind."""
    sensing = load_sensing("lab").but(barometer={"rate": 50, "noise": 0.1})
    assert [name for name in SENSORS if getattr(sensing, name) is None] == ["pixels"]
    first, same, other = (flown_with(sensing, seed).digest() for seed in (3, 3, 4))
    assert first == same != other


@pytest.mark.compiled
def test_a_run_keeps_the_estimate_beside_the_truth(sensed):
    name, run = sensed
    assert run.spec["displace_gates"] == 0.15
    telemetry = read_npz(write_npz(run), run.spec, "run").telemetry
    assert telemetry.keys() == run.telemetry.keys()
    assert ("est_px" in telemetry) == (name != "perfect")
    assert all(np.isfinite(column).all() for column in telemetry.values())


@pytest.mark.compiled
def test_the_errors_of_a_sensed_flight_are_small_and_most_corners_are_found(sensed):
    name, run = sensed
    numbers = sensing_numbers(run)
    if name == "perfect":
        assert numbers is None
        return
    assert 0.0 < numbers["position_rms"] <= numbers["position_max"] < 0.5
    assert numbers["nees"] == pytest.approx(run.telemetry["nees"].mean())
    # Corners in pictures are counted by the estimate, also those that merge with another frame.
    least = 0.3 if name == "pixels" else 0.8
    assert least < (numbers["found"] or 0.95)
    assert name == "pixels" or (numbers["found"] or 0.95) <= 1.0


@pytest.mark.compiled
def test_a_flight_goes_on_by_the_inertial_unit_when_its_pose_sensor_dies(tmp_path):
    """Every number stays finite until the referee ends the flight."""
    mocap = "imu: {rate: 250}\npose: {rate: 100, dies_at: 0.3}\n"
    (tmp_path / "dying.yaml").write_text(mocap)
    spec = Spec.of("split_s_swift", sensing=str(tmp_path / "dying.yaml"), timeout=1.5, **FLIGHT)
    run = RecordedRun.from_frames(spec.record(), flight_frames(spec))
    assert run.outcome in {"crashed", "timeout"}
    assert all(np.isfinite(column).all() for column in run.telemetry.values())
    silent = sensing_numbers(run)["unaided"]
    assert silent == pytest.approx(run.telemetry["t"][-1] - 0.3, abs=0.05)


BAD = {
    "imu: {rate: 0}": "s.yaml:1:13: imu.rate: expected",
    "imu: {rate: 250}": "s.yaml:1:6: imu: expected a pose or a camera",
    "pose: {rate: 100}": "s.yaml:1:1: imu: missing",
    "exact: true\npose: {rate: 9}": "s.yaml:2:7: pose: expected no sensor",
    "imu: {rate: 250}\npose: {rate: 9, spikes: .1}": "s.yaml:2:7: pose.spike: expected",
    "imu: {rate: 250}\npose: {rate: 9, spike: 1}": "s.yaml:2:24: pose.spike: expected spikes",
    "imu: {rate: 250}\npose: {rate: 9, dropout: .1}": "s.yaml:2:26: pose.dropout: expected drop",
    "imu: {rate: 250}\nlidar: {rate: 9}": "s.yaml:2:1: lidar: unknown key",
}


@pytest.mark.parametrize("text", BAD)
def test_a_fault_of_a_sensing_file_is_one_line_with_its_place_and_key(text):
    with pytest.raises(FileError) as error:
        parse_sensing(text, "s.yaml")
    assert str(error.value).startswith(BAD[text])
    assert "\n" not in str(error.value)


def test_every_sensor_of_a_file_is_one_of_the_vehicle():
    """None is read, checked and then left out. A vehicle has one of the two cameras."""
    lens = ", width: 640, height: 360, fx: 320, fy: 320"
    for other in ("camera", "pixels"):
        names = [name for name in SENSORS if name != other]
        needed = dict.fromkeys(("camera", "pixels"), lens)
        lines = [f"{name}: {{rate: 50{needed.get(name, '')}}}" for name in names]
        sensing = parse_sensing("\n".join(lines), "s.yaml")
        assert [name for name in names if getattr(sensing, name) is None] == []


def test_sensings_have_a_source_and_names_are_proposed():
    with pytest.raises(FileError, match="'mocap'"):
        Spec.of("split_s_swift", sensing="mocp")
    assert load_sensing("perfect").exact
    assert all(load_sensing(name).source for name in sensing_names() if name != "perfect")


class Hovers:
    """A controller that keeps the vehicle where it is, level."""

    def control(self, x):
        return (0.0, 0.0, 0.0, 9.81)


def test_the_report_tells_the_scale_and_the_axes_that_the_unit_was_drawn_with():
    exact = {"accelerometer_noise": 0.0, "accelerometer_bias": 0.0, "accelerometer_walk": 0.0}
    drawn = {"gyro_scale": 0.05, "accelerometer_scale": 0.04, "accelerometer_misalignment_deg": 2.0}
    sensing = load_sensing("vio").but(imu={**exact, **drawn})
    run = quadsim.fly(
        "figure8",
        controller=Hovers(),
        sensing=sensing,
        record_sensing=True,
        laps=1,
        timeout=0.1,
        seed=3,
    )
    errors = sensing_numbers(run)["drawn"]
    # The specific force is (0, 0, g): its error along z is of the scale, along x and y of the axes.
    share = run.measurements["imu.specific_force"][5] / 9.81 - (0.0, 0.0, 1.0)
    _, x_to_z, _, y_to_z, _, _ = errors["accelerometer"]["misalignment_deg"]
    assert np.degrees(share[:2]) == pytest.approx([x_to_z, y_to_z], abs=1e-3)
    assert share[2] == pytest.approx(errors["accelerometer"]["scale"][2], abs=1e-5)
    assert not any(errors["gyro"]["misalignment_deg"])
    gyro = ", ".join(f"{100 * scale:+.2g}" for scale in errors["gyro"]["scale"])
    most = max(map(abs, errors["accelerometer"]["misalignment_deg"]))
    report = " ".join(run.report().split())
    assert f"drawn: gyro scale {gyro} %, accelerometer scale " in report
    assert f"%, accelerometer axes {most:.2g} deg off at most" in report
    exact = quadsim.fly("figure8", controller=Hovers(), sensing="vio", laps=1, timeout=0.1)
    assert sensing_numbers(exact)["drawn"] == {}
    assert "drawn:" not in exact.report()
