"""A run has its columns, its laps and its identity."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.dynamics.quadrotor import CONTROL, STATE
from quadsim.racing.events import PENALTY, sector_times
from quadsim.record.run import COLUMNS, RecordedRun
from tests.run_cases import SPEC, event, frame, snapshot, two_laps


def test_telemetry_has_a_unit_for_every_column_and_one_length():
    run = two_laps()
    assert list(run.telemetry) == list(COLUMNS)
    assert {*STATE, *CONTROL} < COLUMNS.keys()
    assert {c.shape for c in run.telemetry.values()} == {(61,)}
    assert run.telemetry["a"][7] == frame(7).x[STATE.index("a")]
    assert run.telemetry["a_cmd"][7] == frame(7).u[CONTROL.index("a_cmd")]


def test_laps_begin_at_zero_end_at_the_last_gate_and_carry_their_own_penalties():
    run = two_laps()
    assert run.penalties == [0.0, PENALTY]
    assert run.laps == pytest.approx([0.3, 0.29 + PENALTY])
    assert sector_times(run.events) == [
        pytest.approx([0.095, 0.105, 0.1]),
        pytest.approx([0.1, 0.1, 0.09]),
    ]
    assert run.gates[0] == {"gate": 1, "lap": 1, "t": 0.095, "offset": (0.1, -0.2), "speed": 12.3}
    assert len(run.gates) == 6


def test_flight_that_nobody_ended_is_interrupted_and_keeps_its_full_laps():
    run = two_laps(outcome=None)
    assert run.outcome == "interrupted"
    assert run.laps == pytest.approx([0.3])


def test_crash_in_the_first_lap_has_no_laps():
    run = RecordedRun.from_frames(
        SPEC, [frame(0), frame(1, events=(event(0.005, "hit"),), outcome="crashed")]
    )
    assert (run.outcome, run.laps, run.penalties, run.gates) == ("crashed", [], [], [])


def test_flight_interrupted_before_its_first_frame_is_still_a_run():
    run = RecordedRun.from_frames(SPEC, [])
    assert (run.outcome, run.laps, len(run.telemetry["t"])) == ("interrupted", [], 0)
    assert len(run.digest()) == 64


def test_a_finished_flight_without_a_pass_has_no_lap_time_and_ends_at_its_last_frame():
    run = RecordedRun.from_frames(SPEC, [frame(0), frame(1), frame(2, outcome="finished")])
    assert (run.laps, run.penalties, run.duration) == ([], [], 0.02)
    assert len(run.digest()) == 64


def test_a_lap_whose_end_no_pass_tells_has_no_time_and_the_laps_before_it_do():
    whole = two_laps()
    cut = replace(whole, events=tuple(e for e in whole.events if e.lap == 1))
    assert (len(whole.laps), cut.laps, cut.penalties) == (2, whole.laps[:1], [0.0])


def test_a_flight_lasts_until_the_event_that_ended_it():
    assert two_laps().duration == 0.59, "between the last two frames"
    assert two_laps(outcome=None).duration == 0.6, "interrupted at a frame"
    assert replace(two_laps(), events=two_laps().events[:-1]).duration == 0.6, (
        "ended without an event"
    )


def test_an_outcome_that_could_not_be_read_back_is_refused():
    with pytest.raises(
        ValueError, match=r"referee: expected an outcome of finished, crashed, .* got 'landed'"
    ):
        RecordedRun.from_frames(SPEC, [frame(0, outcome="landed")])


def test_wall_clock_is_percentiles_and_simulated_over_real_seconds():
    frames = [frame(k, plan_ms=float(k)) for k in range(101)]
    assert RecordedRun.from_frames(SPEC, frames).wall == {
        "plan_ms": {"p50": 50.0, "p95": 95.0},
        "real_time_factor": 0.5,
    }


def test_snapshots_are_kept_where_a_frame_has_them():
    seen = snapshot()
    snapshots = RecordedRun.from_frames(
        SPEC, [frame(0), frame(1, snapshot=seen), frame(2)]
    ).snapshots
    assert snapshots.frames.tolist() == [1]
    assert np.array_equal(snapshots.best, np.float32([seen.best]))
    assert snapshots.terms == {name: np.float32([value]) for name, value in seen.terms.items()}
    assert two_laps().snapshots is None


def test_the_latest_snapshot_is_the_last_one_up_to_a_frame():
    first, second = snapshot(1), snapshot(2)
    snapshots = RecordedRun.from_frames(
        SPEC, [frame(0), frame(1, snapshot=first), frame(2), frame(3, snapshot=second)]
    ).snapshots
    assert snapshots.latest(0) is None
    for i, at, seen in ((1, 1, first), (2, 1, first), (3, 3, second)):
        k, kept = snapshots.latest(i)
        assert k == at
        assert kept.terms == pytest.approx(seen.terms)
        assert np.allclose(kept.best, seen.best)


def test_digest_ignores_the_wall_clock_the_host_and_the_snapshots():
    elsewhere = SPEC | {"host": {"threads": 16}}
    other = two_laps(elsewhere, plan_ms=99.0, snapshot=snapshot())
    assert other.wall != two_laps().wall
    assert other.digest() == two_laps().digest()


def nudge(run, column):
    bits = run.telemetry[column].copy()
    bits[30] = np.nextafter(bits[30], np.inf) if bits.dtype == float else bits[30] + 1
    return replace(run, telemetry=run.telemetry | {column: bits})


def test_digest_sees_the_last_bit_of_every_column():
    run = two_laps()
    seen = {column for column in COLUMNS if nudge(run, column).digest() != run.digest()}
    assert seen == COLUMNS.keys() - {"plan_ms"}


def test_digest_sees_events_spec_and_outcome():
    run = two_laps()
    others = [
        replace(run, events=(replace(run.events[0], speed=12.300000000000002), *run.events[1:])),
        replace(run, outcome="timeout"),
        two_laps(SPEC | {"seed": 4}),
    ]
    assert len({run.digest(), *(other.digest() for other in others)}) == 4


def test_spec_that_json_cannot_hold_is_refused():
    with pytest.raises(TypeError):
        RecordedRun.from_frames({"course": object()}, [])
    with pytest.raises(ValueError, match="JSON"):
        RecordedRun.from_frames({"sigma": float("nan")}, [])
