"""A sweep changes one setting at a time, pairs flights by seed, and shares those of a campaign."""

import csv
import json

import pytest

from quadsim.campaign.flights.sweep import fly_sweep, plan_sweep
from quadsim.campaign.flights.sweep_figure import (
    SIDE_BY_SIDE,
    DrawnCurve,
    DrawnPoint,
    Measured,
    draw_curves,
)
from quadsim.campaign.flights.swept_settings import remarks_on_gamma, swept_settings
from quadsim.cli.cli import race
from quadsim.config.settings import SettingError
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.palette import STYLES
from quadsim.sensing import load_sensing
from quadsim.vehicle import load_vehicle
from tests.campaign_cases import COURSE, FLIGHT, SETTINGS, row, seeds_flown

BOTH = {"gaussian": {"sampler": "gaussian"}, "colored": {"sampler": "colored"}}
SEEDS = 5


def planned(over, variants=BOTH, **settings):
    """Return the curves of a sweep as {(setting, variant): specs by value}."""
    curves = plan_sweep([COURSE], over, variants, SETTINGS | settings)
    return {
        (curve.swept.name, curve.variant): [variant.spec for variant in curve.at_values]
        for curve in curves
    }


def test_each_setting_is_swept_alone_and_for_every_variant():
    found = planned({"link_latency": [0, 0.02, 0.04], "link-hz": ["100", "25"]})
    assert list(found) == [
        ("link_latency", "gaussian"),
        ("link_latency", "colored"),
        ("link_hz", "gaussian"),
        ("link_hz", "colored"),
    ]
    for (setting, variant), specs in found.items():
        latencies = [0.0, 0.02, 0.04] if setting == "link_latency" else [0.0, 0.0]
        rates = [None, None, None] if setting == "link_latency" else [100.0, 25.0]
        assert [spec.link_latency for spec in specs] == latencies
        assert [spec.link_hz for spec in specs] == rates
        assert {spec.sampler for spec in specs} == {variant}


def test_the_end_of_a_name_is_enough_where_no_other_name_ends_alike():
    (swept,) = swept_settings({"latency": ["0", ".02"]})
    assert swept.title == "link_latency [s]"
    with pytest.raises(SettingError, match="no setting 'tau'"):
        swept_settings({"tau": [0.1, 0.2]})


def test_a_number_of_the_vehicle_changes_the_vehicle_and_the_planners_model_of_it():
    swift = load_vehicle("swift")
    ((_, light, heavy),) = planned(
        {"vehicle.mass": ["default", "0.87", "1"]}, {"colored": {}}, vehicle="swift"
    ).values()
    assert light.vehicle == swift
    assert heavy.vehicle == swift.but(mass=1.0)
    assert heavy.model == ModelParams.of(heavy.vehicle) != light.model

    ((_, strong),) = planned(
        {"vehicle.rotors.motor_tau": [0.033, 0.06]},
        {"colored": {}},
        vehicle="swift",
        thrust_to_weight=5,
    ).values()
    assert strong.vehicle.rotors.motor_tau == 0.06
    assert strong.vehicle.thrust_to_weight == pytest.approx(5.0)


def test_several_numbers_of_a_sensor_take_the_same_value():
    vio = load_sensing("vio")
    ((wide, narrow),) = planned(
        {"sensing.camera.fx+sensing.camera.fy": ["320", "500"]}, {"colored": {}}, sensing="vio"
    ).values()
    assert wide.sensing == vio
    assert narrow.sensing == vio.but(camera={"fx": 500, "fy": 500})


def test_settings_that_change_together_take_a_value_each():
    both = {"link_hz+sensing.camera.latency": ["default", "default/.05", "40/.1"]}
    ((plain, late, slow),) = planned(both, {"colored": {}}, sensing="vio").values()
    assert (plain.link_hz, plain.sensing) == (None, load_sensing("vio"))
    assert (late.link_hz, late.sensing.camera.latency) == (None, 0.05)
    assert (slow.link_hz, slow.sensing.camera.latency) == (40.0, 0.1)


def test_numbers_that_change_together_make_a_sensor():
    made = {"sensing.barometer.rate+sensing.barometer.wash": ["default", "50/0", "50/2"]}
    ((none, dry, washed),) = planned(made, {"colored": {}}, sensing="vio").values()
    assert none.sensing == load_sensing("vio")
    assert (dry.sensing.barometer.rate, dry.sensing.barometer.wash) == (50, 0)
    assert washed.sensing == load_sensing("vio").but(barometer={"rate": 50, "wash": 2})


def test_a_sampler_that_lacks_the_setting_is_refused():
    over = {"gamma": [(0.0,) * 4, (2.0,) * 4]}
    with pytest.raises(SettingError, match="gamma: expected variants whose sampler has it, got ga"):
        planned(over)
    ((white, pink),) = planned(over, {"colored": {}}).values()
    assert white.planner.sampling.gamma == (0.0,) * 4
    assert pink.planner.sampling.gamma == (2.0,) * 4


def test_none_is_off_and_default_is_the_presets():
    over = {"cutoff": ["default", "none", "8:8:8:8"]}
    ((usual, off, wide),) = planned(over, {"colored": {}}).values()
    cutoffs = [one.planner.sampling.cutoff for one in (usual, off, wide)]
    assert cutoffs == [(5.0,) * 4, (), (8.0,) * 4]
    ((of_preset, _),) = planned({"target_ess": [None, 50]}, {"colored": {}}).values()
    assert of_preset.planner.mppi.target_ess == 20


@pytest.mark.parametrize(
    ("cutoff", "expected"), [({}, 1), ({"cutoff": "none"}, 0), ({"cutoff": (0.0,) * 4}, 0)]
)
def test_a_sweep_of_gamma_says_that_a_cut_off_stays(cutoff, expected):
    over = {"gamma": [(0.0,) * 4, (2.0,) * 4]}
    (curve,) = plan_sweep([COURSE], over, {"colored": cutoff}, SETTINGS)
    assert len(list(remarks_on_gamma(curve.swept, curve.at_values))) == expected


@pytest.mark.parametrize(
    ("over", "expected"),
    [
        ({}, "expected a setting and its values"),
        ({"link_latency": [0]}, "link_latency: expected 2 values or more"),
        ({"link_latency": "0"}, "link_latency: expected 2 values or more"),
        ({"link_latency": [0, "0"]}, "link_latency: expected different values"),
        ({"latency": [0, 1], "link_latency": [0, 1]}, "expected different settings"),
        ({"link_hz+dt": ["40/.1", "1/2/3"]}, "link_hz+dt: expected one value, or 2 joined by /"),
        ({"vehicle.mass": [0.5, "heavy"]}, "vehicle.mass: expected a number"),
        ({"vehicle.masses": [0.5, 1]}, "vehicle.masses: "),
        ({"sensing.camera.noise": [1, 2]}, "sensing.camera.noise: expected a flight on sensors"),
    ],
)
def test_what_cannot_be_swept_is_one_line(over, expected):
    with pytest.raises(SettingError) as caught:
        planned(over)
    assert (caught.value.name, caught.value.problem[: len(expected)]) == ("over", expected)
    assert "\n" not in caught.value.problem


def test_a_variant_with_a_value_of_its_own_is_refused():
    with pytest.raises(SettingError, match="samples: expected variants without a value"):
        planned({"samples": [128, 256]}, {"few": {"samples": 64}})


def rows_of(variants, attempts):
    """Return flights whose laps differ by seed, and by half a second from value to value."""
    found = []
    for number, _ in enumerate(variants):
        late = 0.5 * number
        of_seeds = [row(seed, laps=(5.0 + seed * seed + late,)) for seed in range(attempts)]
        # The last value crashes with the first two seeds.
        if number == 2:
            of_seeds[:2] = [row(seed, outcome="crashed") for seed in range(2)]
        found.append(of_seeds)
    return found


def test_changes_are_those_of_the_same_seeds(tmp_path):
    curves = plan_sweep([COURSE], {"link_latency": [0, 0.02, 0.04]}, {"colored": {}}, SETTINGS)
    first, second, third = fly_sweep(curves, SEEDS, rows_of, tmp_path).points
    assert first.change is None
    for point, change, pairs in ((second, 0.5, SEEDS), (third, 1.0, SEEDS - 2)):
        found = point.change.lap_difference
        assert found.n == pairs
        assert found.mean == pytest.approx(change)
        assert found.high - found.low == pytest.approx(0.0, abs=1e-9)
    # Without pairs the seeds that are missing at the last value would make it seem slower still.
    assert third.stats.lap_mean - first.stats.lap_mean > 2.0
    assert (third.change.only_a, third.change.only_b) == (2, 0)


@pytest.mark.compiled
def test_a_default_value_is_the_flight_of_the_variant_itself(campaign, capsys, monkeypatch):
    monkeypatch.setattr(
        "quadsim.campaign.run.runner.open_pool", lambda *_: pytest.fail("flown again")
    )
    before = seeds_flown(campaign)
    words = ["sweep", *FLIGHT, "--attempts", "3", "--campaign", str(campaign)]
    over = ["--over", "link-latency", "0", "default", "--over", "randomize", "0", "default"]
    assert race([*words, *over, "--json"]) == 0
    points = json.loads(capsys.readouterr().out)["points"]
    assert [(p["setting"], p["value"], p["variant"]) for p in points] == [
        (setting, value, sampler)
        for setting in ("link_latency", "randomize")
        for sampler in ("gaussian", "colored")
        for value in ("0", "default")
    ]
    assert {p["stats"]["attempts"] for p in points} == {3}
    assert seeds_flown(campaign) == before
    report = {path.suffix: path for path in (campaign.parent / "c.report").iterdir()}
    assert "| 0, gaussian | 0/3 |" in report[".md"].read_text()
    assert report[".png"].read_bytes().startswith(b"\x89PNG")
    rows = list(csv.DictReader(report[".csv"].open()))
    assert [(r["setting"], r["value"], r["variant"]) for r in rows] == [
        (p["setting"], p["value"], p["variant"]) for p in points
    ]
    for row_, point in zip(rows, points, strict=True):
        assert float(row_["stats.thrust_tv"]) == point["stats"]["thrust_tv"]
        assert row_["stats.lap_mean"] == ""  # nobody finishes
    # There is no change at the first value.
    assert (rows[0]["change.seeds"], rows[1]["change.seeds"]) == ("", "3")


def test_a_setting_that_is_given_twice_is_one_line(capsys):
    words = ["sweep", *FLIGHT, "--over", "dt", ".01", ".02", "--over", "dt", ".02", ".04"]
    assert race(words) == 2
    assert capsys.readouterr().err.startswith("race sweep: --over: expected dt once")


def test_a_competition_brings_its_course(capsys):
    words = ["sweep", "--over", "margin", "0", "1", "--competition", "aigp_physical"]
    assert race([*words, "--laps", "1001"]) == 2
    assert capsys.readouterr().err.startswith("race sweep: --laps: expected")


def test_more_settings_than_fit_side_by_side_continue_below():
    point = DrawnPoint(0, Measured(100.0, 70.0, 100.0), Measured(0.0))
    curves = [
        DrawnCurve("course", f"setting {k}", ("0", "1"), variant, (point,))
        for k in range(SIDE_BY_SIDE + 1)
        for variant in ("gaussian", "colored")
    ]
    bands = draw_curves(curves).subfigs
    titles = [[axes.get_xlabel() for axes in band.axes if axes.get_xlabel()] for band in bands]
    assert titles == [["setting 0", "setting 1", "setting 2"], ["setting 3", "setting 4"]]
    # A sampler has its colour in every band, as on all other pages.
    for band in bands:
        drawn = {line.get_label(): line.get_color() for line in band.axes[0].lines}
        for name in ("gaussian", "colored"):
            assert drawn[name] == STYLES[name].colour
