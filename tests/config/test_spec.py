"""Spec: settings, presets and vehicles become one record, which alone decides the flight."""

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

import quadsim
from quadsim.config.build import build, with_threads
from quadsim.config.presets import parse_planner
from quadsim.config.settings import SETTINGS, SettingError
from quadsim.config.spec import Spec
from quadsim.controllers.costs import Term
from quadsim.controllers.presets import PRESETS
from quadsim.controllers.samplers import SAMPLERS, Colored, Gaussian
from quadsim.course import course_names, load_course
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.files.strict_yaml import FileError
from quadsim.vehicle import load_vehicle
from tests.small import SMALL


def small(course=None, **settings) -> Spec:
    """Return the default course with a small budget."""
    return Spec.of(course, **SMALL | {"timeout": 0.3, "laps": 1} | settings)


@pytest.mark.compiled
@pytest.mark.parametrize("sampler", ["gaussian", "colored"])
def test_same_seed_same_run_to_the_last_bit_with_one_thread_or_two(sampler, on_threads):
    def flown(**settings):
        # So many samples that both threads draw some
        spec = small(sampler=sampler, samples=512, timeout=0.1, **settings)
        return quadsim.fly(spec).digest()

    digests = {on_threads(n, lambda n=n: flown(threads=n)) for n in (1, 2)}
    assert len(digests) == 1
    assert flown(seed=1) not in digests, "another seed is another run"


def test_record_is_json_and_holds_every_number():
    record = json.loads(json.dumps(small().record()))
    assert record["planner"]["mppi"] | SMALL == record["planner"]["mppi"]
    assert record["planner"]["sampling"]["sigma"] == list(PRESETS["race"]["colored"].sampling.sigma)
    assert record["course"]["text"].startswith("#")
    assert record["vehicle"]["rotors"]["motor_tau"] == 0.033


@pytest.mark.parametrize("preset", PRESETS)
def test_defaults_are_the_presets_own(preset):
    for sampler, planner in PRESETS[preset].items():
        spec = Spec.of(preset=preset, sampler=sampler)
        assert spec.planner == planner
        assert (spec.preset, spec.sampler) == (preset, sampler)


@pytest.mark.parametrize("course", course_names())
def test_a_course_may_be_a_name_or_an_object(course):
    assert small(course) == small(load_course(course))


def test_planner_has_the_vehicles_nominal_model_unless_told():
    own = small()
    assert own.model == ModelParams.of(own.vehicle)
    assert small(model_drag=0).model == replace(own.model, drag=0.0)


def test_a_text_is_read_as_in_a_file_and_gives_the_same_spec():
    texts = {
        "samples": "128",
        "sigma": ("1", "1", ".5", "4e0"),
        "smooth": "true",
        "seed": "3",
        "target_ess": "20",
    }
    numbers = {"samples": 128, "sigma": (1, 1, 0.5, 4), "smooth": True, "seed": 3, "target_ess": 20}
    assert Spec.of(**texts) == Spec.of(**numbers)


def test_timeout_grows_with_the_laps():
    one = small(timeout=None)
    three = small(timeout=None, laps=3)
    assert three.timeout - one.timeout == pytest.approx(one.course.lap_length)
    assert small(timeout=7).timeout == 7.0


# A spec that is changed


def test_a_changed_sampler_brings_its_own_numbers():
    changed = small().but(sampler="gaussian")
    assert changed == small(sampler="gaussian")
    assert changed.sampler == changed.record()["sampler"] == "gaussian"
    assert isinstance(changed.planner.sampling, Gaussian)


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 7},
        {"sampler": "smooth"},
        {"vehicle": "kingfisher"},
        {"preset": "paper"},
        {"laps": 2},
        {"model_drag": 0.0},
        {"thrust_to_weight": 3.0},
        {"sensing": "vio"},
        {"course": "figure8"},
        {"sigma": (1.0, 1.0, 1.0, 1.0)},
        {"penalties": True, "randomize": 1.0},
    ],
)
def test_a_changed_spec_is_the_spec_of_the_changed_settings(change):
    settings = {**SMALL, "timeout": 0.3, "horizon": 50}
    changed = Spec.of("split_s_swift", **settings).but(**change)
    assert changed == Spec.of(**{"course": "split_s_swift", **settings, **change})


def test_none_is_the_default_again():
    assert small(laps=2, sigma=(1, 1, 1, 1), vehicle="cpc").but(
        laps=None, sigma=None, vehicle=None, timeout=None
    ) == Spec.of(**SMALL)


def test_a_number_of_the_first_sampler_is_refused_by_the_next():
    with pytest.raises(SettingError, match=r"gamma: .* colored sampling only"):
        small(gamma=(1, 1, 1, 1)).but(sampler="gaussian")


def test_a_file_is_read_once(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("base: race\nmppi: {samples: 300}\n")
    spec = Spec.of(preset=str(file))
    file.unlink()
    assert spec.but(seed=1).planner.mppi.samples == 300
    assert spec.but(seed=1).preset == str(file)


def test_labels_follow_the_content():
    spec = small()
    with pytest.raises(TypeError):
        replace(spec, sampler="gaussian")  # the label cannot be set
    gaussian = replace(spec, planner=PRESETS["paper"]["gaussian"])
    assert (gaussian.sampler, gaussian.preset) == ("gaussian", "paper")
    assert gaussian.record()["sampler"] == "gaussian"
    other = replace(spec, vehicle=load_vehicle("kingfisher")).record()
    assert other["vehicle"]["name"] == other["planner"]["vehicle"] == "kingfisher"


def test_a_spec_made_of_its_parts_keeps_them_when_it_is_changed():
    spec = small()
    planner = replace(spec.planner, sampling=Colored((1.0,) * 4, (1.0,) * 4))
    own = replace(spec, planner=planner)
    assert own.but(seed=3) == replace(own, seed=3)
    with pytest.raises(SettingError, match="sampler: expected none: the planner of"):
        own.but(sampler="gaussian")


@pytest.mark.compiled
def test_fly_changes_a_spec_or_refuses():
    spec = small(timeout=0.05)
    assert quadsim.fly(spec, seed=7).spec["seed"] == 7
    with pytest.raises(SettingError, match="bogus: no such setting"):
        quadsim.fly(spec, bogus=1)


def test_parts_of_the_wrong_kind_are_refused_by_name():
    spec = small()
    for name in ("course", "vehicle", "planner", "model", "plant"):
        with pytest.raises(SettingError, match=f"^{name}: expected"):
            replace(spec, **{name: "nothing"})
    for name in ("controller", "referee"):
        with pytest.raises(SettingError, match=f"^{name}: expected"):
            replace(spec, **{name: 3})


@pytest.mark.parametrize(
    "settings",
    [
        {"planner": "race"},
        {"preset": 3},
        {"preset": 3.5},
        {"model": 0},
        {"model": "swift", "model_drag": 0.1},
        {"plant": ""},
        {"terms": 0},
        {"pilot": 3},
        {"course": np.zeros((3, 3))},
    ],
    ids=str,
)
def test_an_object_of_the_wrong_type_is_refused_in_one_line(settings):
    (name, *_) = settings
    with pytest.raises(SettingError, match=f"^{name}: expected") as refused:
        Spec.of(**settings)
    assert "\n" not in str(refused.value)


def test_no_terms_are_the_default_again():
    def calm(x, x_next, u, gate, p):
        return u.wx * u.wx

    assert small(terms=[(calm, 1.0)]).but(terms=None) == small()


@pytest.mark.parametrize(
    "number",
    [
        {"laps": None},
        {"laps": 0},
        {"timeout": float("nan")},
        {"seed": -1},
        {"plant_dt": 0.0},
        {"randomize": float("inf")},
        {"clock": "sundial"},
        {"threads": 1.5},
        {"view_weight": None},
    ],
    ids=str,
)
def test_a_spec_made_of_its_parts_has_the_ranges_of_its_settings(number):
    """A timeout that is not a number would never end a flight."""
    (name,) = number
    with pytest.raises(SettingError, match=f"^{name}: expected"):
        replace(small(), **number)


@pytest.mark.parametrize(
    ("name", "part"),
    [("deadline_ms", 5.0), ("controller", lambda spec: None)],
)
def test_a_pilot_has_neither_a_deadline_nor_another_controller_beside_it(name, part):
    with pytest.raises(SettingError, match=f"^{name}: expected none beside a pilot"):
        Spec.of("split_s_swift", pilot="split_s_swift", **{name: part})


def test_a_spec_survives_pickling_with_what_was_given():
    spec = pickle.loads(pickle.dumps(small(seed=2)))
    assert spec == small(seed=2)
    assert spec.but(laps=2) == small(seed=2, laps=2)


def test_objects_take_the_place_of_names():
    vehicle = replace(load_vehicle("swift"), drag=(0.0, 0.0, 0.0))
    assert small(vehicle=vehicle).vehicle is vehicle
    assert small(vehicle=vehicle, sampler=SAMPLERS["gaussian"]((1.0,) * 4)).sampler == "gaussian"
    assert small(model=ModelParams.of(vehicle)).model.drag == 0.0


def test_terms_are_part_of_the_record():
    def calm(x, x_next, u, gate, p):
        return u.wx * u.wx

    spec = small(terms=[(calm, 2.0)])
    assert [(type(term), term.function) for term in spec.terms] == [(Term, calm)]
    (term,) = spec.record()["own"]["terms"]
    assert (term["name"], term["weight"]) == ("calm", 2.0)


def test_build_gives_parts_by_name():
    parts = build(small(overshoot=0.0))  # Otherwise perturbations are drawn to measure them.
    parts.plant.close()
    assert parts.referee.passed == 0
    assert parts.controller.rest.shape == (4,)


def test_threads_that_this_machine_lacks_are_refused():
    with pytest.raises(SettingError, match="threads: expected 1 to"):
        with_threads(small(threads=10**6))


# The table of settings


def test_every_setting_has_a_help_and_one_name():
    assert [name for name, setting in SETTINGS.items() if not setting.help] == []
    assert len({setting.flag for setting in SETTINGS.values()}) == len(SETTINGS)


def test_the_keywords_for_type_checkers_are_up_to_date():
    from quadsim.tables.write_keywords import FILE, keywords_module

    advice = "run: python -m quadsim.tables.write_keywords"
    assert FILE.read_text(encoding="utf-8") == keywords_module(), advice


def test_arrays_are_numbers_too():
    assert small(sigma=np.ones(4)) == small(sigma=(1, 1, 1, 1))


# Preset files

PRESET = """
base: race
vehicle: kingfisher
sampling: {gamma: [3, 3, 3, 2]}
mppi: {samples: 2048, target_ess: null}
"""


@pytest.mark.parametrize("sampler", ["gaussian", "colored"])
def test_preset_file_changes_what_it_says_and_nothing_else(sampler):
    base = PRESETS["race"][sampler]
    planner = parse_planner(PRESET, "mine.yaml", sampler)
    assert (planner.preset, planner.vehicle) == ("mine.yaml", "kingfisher")
    # Keys of other samplers are skipped.
    own = {"gamma": (3.0, 3.0, 3.0, 2.0)} if sampler == "colored" else {}
    assert planner.sampling == replace(base.sampling, **own)
    assert planner.mppi == replace(base.mppi, samples=2048, target_ess=None)
    assert planner.cost == base.cost


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("base: rase\n", "p.yaml:1:7: base: no preset 'rase'"),
        ("mppi: {samples: 9}\n", "base: missing"),
        ("base: race\nmpi: {samples: 9}\n", "p.yaml:2:1: mpi: unknown key"),
        ("[1]", "p.yaml:1:1: expected a mapping"),
        ("1", "p.yaml:1:1: expected a mapping"),
        ("[base, race]", "p.yaml:1:1: expected a mapping"),
        ("base: race\nmppi: {dt: 1e-2, dt: 2}\n", "mppi.dt: duplicate key"),
        (
            "base: race\nmppi: {samples: 20, target_ess: 200}\n",
            "p.yaml:2:33: mppi.target_ess: expected an effective sample size below samples = 20",
        ),
        ("base: race\nsampling: {sigma: [1, 1, 1, 0]}\n", "sampling.sigma[3]: expected a number"),
        ("base: race\nsampling: {sigma: [1, 1, 1]}\n", "[rad/s, rad/s, rad/s, m/s^2], got 3"),
        ("base: race\nsampling: {gama: [1, 1, 1, 1]}\n", "p.yaml:2:12: sampling.gama: unknown key"),
        ("base: race\nsampling: {law: pink}\n", "sampling.law: expected 'exact'"),
    ],
)
def test_preset_file_errors_name_the_place(text, place):
    with pytest.raises(FileError) as caught:
        parse_planner(text, "p.yaml", "colored")
    assert place in str(caught.value)


def test_a_law_without_a_cut_off_leaves_out_that_of_the_preset():
    assert Spec.of("figure8", law="paper").planner.sampling.cutoff == ()
    assert Spec.of("figure8", law="exact").planner.sampling.cutoff == (5.0,) * 4
    with pytest.raises(SettingError, match=r"^cutoff: expected none with the law paper"):
        Spec.of("figure8", law="paper", cutoff=(5.0,) * 4)


@pytest.mark.parametrize("none", [None, "none", ["none"] * 4, (0.0,) * 4])
def test_none_switches_off_the_cut_off_of_the_preset(none):
    assert not any(Spec.of("figure8", cutoff=none).planner.sampling.cutoff)


def test_none_switches_off_only_settings_that_can_be_off():
    assert Spec.of("figure8", target_ess="none").planner.mppi.target_ess is None
    with pytest.raises(SettingError, match=r"^samples: expected a whole number .* got 'none'"):
        Spec.of("figure8", samples="none")
    with pytest.raises(SettingError, match=r"^cutoff: expected 4 numbers .*, or none, got 'off'"):
        Spec.of("figure8", cutoff="off")


def test_another_control_period_keeps_the_time_that_is_planned_ahead():
    usual = Spec.of("figure8").planner.mppi
    faster = Spec.of("figure8", dt=0.005).planner.mppi
    assert faster.horizon * faster.dt == pytest.approx(usual.horizon * usual.dt)
    assert Spec.of("figure8", dt=0.025, horizon=40).planner.mppi.horizon == 40
    assert Spec.of("figure8", dt=usual.dt).planner.mppi == usual
