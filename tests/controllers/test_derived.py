"""The numbers of the preset `race` follow from vehicle, course and control period by laws."""

import json
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest

from quadsim.config.spec import Spec
from quadsim.controllers.derived import (
    LONGEST,
    MOST_SAMPLES,
    NARROW_SHARE,
    Scale,
    clearance,
    density,
    derivation,
    derived,
    horizon,
    margin,
    margin_share,
    samples,
    sight_law,
    view_weight,
)
from quadsim.controllers.presets import PRESETS, contradictions, with_period
from quadsim.controllers.samplers.colored import spectrum
from quadsim.course import course_names, load_course
from quadsim.report.preset_changes import preset_changes, recorded_derivation
from quadsim.vehicle import load_vehicle, vehicle_names

RACE = PRESETS["race"]
COLORED = RACE["colored"]
# The courses and vehicles on which the preset was tuned, and the default vehicle elsewhere
REFERENCES = [
    ("split_s_swift", "swift"),
    ("split_s_song", "cpc-twr3.3"),
    ("alphapilot", "flightmare-twr6.4"),
    ("figure8", "swift"),
]
# A small course, well within the limits of the laws
SMALL = Scale.of(load_course("lsy_track"), load_vehicle("cf21b_500"), 0.01)


def similar(scale, k):
    """Return the scale of a similar flight: lengths times k, times times sqrt(k), gravity alike."""
    lengths = {name: k * getattr(scale, name) for name in ("leg", "frame", "room", "radius")}
    times = {name: k**0.5 * getattr(scale, name) for name in ("yaw_lag", "period")}
    return scale._replace(**lengths, **times)


@pytest.mark.parametrize(("course", "vehicle"), REFERENCES)
@pytest.mark.parametrize("sampler", RACE)
def test_at_the_reference_the_numbers_are_the_references_to_the_last_digit(
    course, vehicle, sampler
):
    scale = Scale.of(load_course(course), load_vehicle(vehicle), 0.01)
    assert derived(RACE[sampler], scale) == RACE[sampler]


@pytest.fixture(scope="module")
def all_flights():
    """Return every course with every vehicle."""
    courses = [load_course(name) for name in course_names()]
    return list(product(courses, [load_vehicle(name) for name in vehicle_names()]))


@pytest.mark.parametrize("sampler", RACE)
@pytest.mark.parametrize("dt", [0.002, 0.01, 0.025, 0.1])
def test_every_vehicle_has_numbers_in_range_on_every_course(all_flights, sampler, dt):
    """The dataclasses check the ranges."""
    for course, vehicle in all_flights:
        for seen_late in (False, True):
            scale = Scale.of(course, vehicle, dt, seen_late)
            planner = with_period(derived(RACE[sampler], scale), dt)
            assert not list(contradictions(planner)), (course.name, vehicle.name)
            assert planner.mppi.samples <= MOST_SAMPLES
            assert 0.0 < planner.cost.margin_share <= 0.5


def test_odd_courses_have_numbers_in_range_even_a_lap_without_a_length():
    odd = Path(__file__).parents[1] / "courses_nasty"
    courses = [load_course(str(path)) for path in odd.glob("*.yaml")]
    assert min(course.lap_length for course in courses) == 0.0
    for course in courses:
        planner = derived(COLORED, Scale.of(course, load_vehicle("swift"), 0.01))
        assert not list(contradictions(planner)), course.name


@pytest.mark.parametrize("k", [0.3, 0.8, 1.5])
def test_similar_flights_have_similar_numbers(k):
    """Lengths scale by k and times by sqrt(k) (Froude), so each number scales by its unit."""
    other = similar(SMALL, k)
    assert sight_law(other) == pytest.approx(k**0.5 * sight_law(SMALL))
    share = COLORED.cost.margin_share
    assert margin_share(share, other).value == pytest.approx(margin_share(share, SMALL).value)
    assert margin(1e9, other).value == pytest.approx(k * margin(1e9, SMALL).value, rel=0.01)
    weights = [clearance(COLORED.cost, scale).value for scale in (SMALL, other)]
    assert weights[1] == pytest.approx(weights[0] / k**2, rel=0.01)
    assert view_weight(1.0, other) == view_weight(1.0, SMALL)
    assert view_weight(1.0, SMALL._replace(yaw_lag=0.5)) == 0.0


def test_similar_flights_have_similar_noise():
    """With k = 2.25 the horizon of 1 s becomes the 1.5 s of the reference, to the last step."""
    other = similar(SMALL, 2.25)
    assert (horizon(SMALL).value, horizon(other).value) == (1.0, 1.5)
    near, far = derived(COLORED, SMALL).sampling, derived(COLORED, other).sampling
    for rate in range(3):
        assert near.sigma[rate] == pytest.approx(1.5 * far.sigma[rate], rel=0.01)
    assert near.sigma[3] == pytest.approx(far.sigma[3], rel=0.01), "an acceleration"
    assert near.cutoff == pytest.approx([1.5 * f for f in far.cutoff])


def test_a_vehicle_that_can_yaw_has_more_noise_of_yaw_up_to_the_share_of_roll():
    for k in (1.0, 2.25):
        able = similar(SMALL._replace(yaw_gain=1.5), k)
        usual = similar(SMALL, k)
        roll, _, yaw, _ = derived(COLORED, able).sampling.sigma
        assert derived(COLORED, usual).sampling.sigma[2] < yaw
        assert yaw / roll < SMALL.yaw_limit
        limited = derived(COLORED, able._replace(yaw_gain=1e3, yaw_limit=0.4)).sampling.sigma
        assert limited[2] / limited[0] == pytest.approx(0.4, rel=0.01)
    unable = derived(COLORED, SMALL._replace(yaw_gain=0.0, yaw_limit=0.0)).sampling
    assert unable.sigma[2] == derived(COLORED, SMALL).sampling.sigma[2]


def test_horizon_and_samples_grow_with_their_causes_and_keep_their_limits():
    longer = SMALL._replace(leg=1.3 * SMALL.leg)
    assert sight_law(longer) > sight_law(SMALL)
    assert sight_law(SMALL._replace(acceleration=2 * SMALL.acceleration)) < sight_law(SMALL)
    assert horizon(SMALL._replace(leg=1e3)).value == LONGEST
    open_air = SMALL._replace(frame=0.1)
    counts = [samples(1024, scale).value for scale in (open_air, SMALL, SMALL._replace(frame=9.0))]
    assert counts == [1024 * 2, MOST_SAMPLES, MOST_SAMPLES]
    assert samples(1024, open_air._replace(period=0.005)).value == 1024, "never fewer"
    tight = open_air._replace(room=0.1 * SMALL.room)
    assert samples(1024, tight).value > samples(1024, open_air).value
    assert sight_law(tight) > sight_law(open_air)
    narrow = open_air._replace(room=open_air.leg * NARROW_SHARE / 1.5)
    assert samples(1024, narrow).value > samples(1024, open_air).value
    assert sight_law(narrow) == sight_law(open_air)


def test_the_value_of_the_course_shortens_the_horizon_where_its_way_can_be_flown():
    split_s, swift = load_course("split_s_swift"), load_vehicle("swift")
    usual = Scale.of(split_s, swift, 0.01)
    assert derived(COLORED, usual).cost.time_to_go > 0.0
    others = [
        usual._replace(room=0.5 * NARROW_SHARE * usual.leg),
        usual._replace(frame=0.5 * usual.leg),
        usual._replace(has_obstacles=True),
        usual._replace(may_value=False),
    ]
    for other in others:
        planner = derived(COLORED, other)
        assert (planner.cost.time_to_go, planner.mppi.longer_steps) == (0.0, None), other
        assert horizon(other).value == LONGEST > horizon(usual).value
    slow = derived(COLORED, usual._replace(period=0.025))
    assert slow.cost.time_to_go > 0.0
    assert slow.mppi.horizon * slow.mppi.dt == LONGEST


def test_a_flight_without_the_value_of_the_course_has_the_longer_horizon():
    usual, without = (Spec.of("split_s_swift", **given) for given in ({}, {"time_to_go": 0}))
    assert without.planner.mppi.horizon > usual.planner.mppi.horizon
    changes = preset_changes(json.loads(json.dumps(without.record())))
    assert changes == "horizon 150, longer_steps none, time_to_go 0"
    laws = {number.name: number for number in recorded_derivation(without.record())}
    assert laws["horizon"].value == without.planner.mppi.horizon
    assert laws["time_to_go"].law == "0, as the weight was given as 0"


def test_margins_grow_with_the_room_and_its_weight_falls():
    tight = SMALL._replace(room=0.5 * SMALL.room)
    assert (
        margin(0.3, tight).value
        < margin(0.3, SMALL).value
        <= margin(0.3, SMALL._replace(room=9.0)).value
        == 0.3
    )
    assert clearance(COLORED.cost, tight).value > clearance(COLORED.cost, SMALL).value > 2500
    slim = SMALL._replace(radius=0.3 * SMALL.radius)
    assert margin_share(0.25, slim).value < margin_share(0.25, SMALL).value


def test_margins_are_larger_with_a_control_period_of_more_than_20_ms():
    roomy = SMALL._replace(room=9.0)
    shares = [margin_share(0.25, roomy._replace(period=dt)).value for dt in (0.01, 0.02, 0.025)]
    assert shares == [0.25, 0.25, 0.4]
    assert margin_share(0.45, roomy._replace(period=0.025)).value == 0.45


@pytest.mark.parametrize("gamma", [0.0, 0.8, 2.0])
def test_the_noise_below_the_cut_off_does_not_depend_on_the_control_period(gamma):
    """The power at each low frequency stays; without the factor it does not, but for gamma 2."""

    def power(steps, factor):
        # of the third frequency of the horizon
        return (factor * spectrum(2 * steps, gamma, "exact")[3]) ** 2

    short, usual = density(gamma, 60), density(gamma, 150)
    assert power(60, short) == pytest.approx(power(150, usual))
    assert usual == 1.0
    assert (power(60, 1.0) > 1.1 * power(150, 1.0)) == (gamma < 2.0)


def test_what_is_given_counts_before_the_law():
    small = {"course": "lsy_level2", "vehicle": "crazyflie"}
    usual = Spec.of(**small).planner
    assert (usual.mppi.horizon, usual.mppi.samples) == (100, 4096)
    given = Spec.of(**small, samples=512, margin=0.2, dt=0.02).planner
    assert (given.mppi.samples, given.cost.margin, given.mppi.horizon) == (512, 0.2, 50)
    assert given.cost.clearance == usual.cost.clearance


def test_a_file_counts_before_the_law_and_its_control_period_within_it(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("base: race\nmppi: {samples: 256, dt: 0.02}\nvehicle: crazyflie\n")
    planner = Spec.of("lsy_level2", preset=str(file)).planner
    at_law = Spec.of("lsy_level2", vehicle="crazyflie", dt=0.02).planner
    assert planner.mppi == replace(at_law.mppi, samples=256)
    assert (planner.sampling, planner.cost) == (at_law.sampling, at_law.cost)


@pytest.mark.parametrize("name", ["race_informed", "paper"])
def test_other_presets_keep_their_numbers(name):
    assert Spec.of("figure8", preset="paper", vehicle="crazyflie").planner.mppi.samples == 4096
    scale = Scale.of(load_course("lsy_level2"), load_vehicle("crazyflie"), 0.01)
    from quadsim.config.presets import PresetSource

    source = PresetSource.read(name)
    assert source.planner("colored", scale=scale) == PRESETS[name]["colored"]


def test_gates_that_are_seen_late_bring_the_terms_for_them():
    level = Spec.of(competition="lsy_level2").planner
    assert (level.mppi.first_noise, level.cost.caution > 0) == (1.0, True)
    assert level.mppi.news_iterations > level.mppi.iterations
    for known in ({"randomize": 0}, {"competition": "lsy_level1"}):
        other = Spec.of(**{"competition": "lsy_level2", **known}).planner
        assert (other.mppi.news_iterations, other.cost.caution) == (None, 0.0), known


def test_a_record_says_which_numbers_are_derived_and_names_those_that_were_given():
    spec = Spec.of(competition="lsy_level2", samples=256)
    record = json.loads(json.dumps(spec.record()))
    assert preset_changes(record) == "samples 256"
    laws = {number.name: number for number in recorded_derivation(record)}
    assert laws["horizon"].value == spec.planner.mppi.horizon
    assert laws["samples"].value == MOST_SAMPLES
    assert "leg 1.66 m" in laws["horizon"].law
    assert "known only from nearby" in laws["caution"].law
    assert recorded_derivation(Spec.of("figure8", preset="paper").record()) == []


def test_each_law_names_the_number_that_is_flown():
    late = SMALL._replace(seen_late=True)
    planner = derived(COLORED, late)
    found = {number.name: number.value for number in derivation(COLORED, late)}
    flown = vars(planner.sampling) | vars(planner.mppi) | vars(planner.cost)
    assert {name: flown[name] for name in found} == found
    unnamed = [name for name, value in flown.items() if name not in found]
    usual = vars(COLORED.sampling) | vars(COLORED.mppi) | vars(COLORED.cost)
    assert [name for name in unnamed if flown[name] != usual[name]] == []
