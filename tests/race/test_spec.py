"""What is flown: settings, presets and vehicles resolved to one record, which alone decides the
flight."""

import json
from dataclasses import replace

import pytest

import quadsim
from controllers.presets import PRESETS
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.files.strict_yaml import FileError
from quadsim.spec.preset_file import parse_planner
from quadsim.spec.spec import Spec
from quadsim.spec.systems import SYSTEMS

SMALL = {"samples": 256, "horizon": 40, "iterations": 1}


def small(**settings) -> Spec:
    """The default course with a small budget."""
    return Spec.of(**SMALL | {"timeout": 0.3, "laps": 1} | settings)


@pytest.mark.parametrize("sampler", ["gaussian", "colored"])
def test_same_seed_same_run_to_the_last_bit_with_one_thread_or_two(sampler, on_threads):
    def flown(**settings):
        return quadsim.fly(small(sampler=sampler, **settings)).digest()

    digests = {on_threads(n, lambda n=n: flown(threads=n)) for n in (1, 2, 2)}
    assert len(digests) == 1
    assert flown(seed=1) not in digests, "another seed, another run"


def test_record_is_json_and_holds_every_number():
    record = json.loads(json.dumps(small().record()))
    assert record["planner"]["mppi"] | SMALL == record["planner"]["mppi"]
    assert record["planner"]["sampling"]["sigma"] == list(PRESETS["race"]["colored"].sampling.sigma)
    assert record["course_text"].startswith("#")
    assert record["vehicle"]["rotors"]["tau"] == 0.033


@pytest.mark.parametrize("system", SYSTEMS)
def test_defaults_are_the_presets_own(system):
    for preset, samplers in SYSTEMS[system].presets.items():
        for sampler, planner in samplers.items():
            assert Spec.of(system=system, preset=preset, sampler=sampler).planner == planner


def test_a_course_brings_its_system():
    assert {Spec.of(entry.default_course).system: name for name, entry in SYSTEMS.items()} == {
        n: n for n in SYSTEMS
    }


def test_planner_has_the_vehicles_nominal_model_unless_told():
    own = small()
    assert own.model == ModelParams.of(own.vehicle)
    assert small(**{"model.drag": 0}).model == replace(own.model, drag=0.0)


def test_a_text_is_read_as_in_a_file_and_gives_the_same_spec():
    words = {
        "samples": "256",
        "sigma": ("1", "1", ".5", "4e0"),
        "smooth": "true",
        "seed": "3",
        "target-ess": "20",
    }
    given = {"samples": 256, "sigma": (1, 1, 0.5, 4), "smooth": True, "seed": 3, "target_ess": 20}
    assert Spec.of(**{k.replace("-", "_"): v for k, v in words.items()}) == Spec.of(**given)


def test_timeout_grows_with_the_laps():
    one, three = small(timeout=None), small(timeout=None, laps=3)
    assert three.timeout - one.timeout == pytest.approx(one.course.lap_length)
    assert small(timeout=7).timeout == 7.0


PRESET = """
base: race
vehicle: kingfisher
sampling: {gamma: [3, 3, 3, 2]}
mppi: {samples: 2048, target_ess: null}
"""


@pytest.mark.parametrize("sampler", ["gaussian", "colored"])
def test_preset_file_changes_what_it_says_and_nothing_else(sampler):
    base = PRESETS["race"][sampler]
    planner = parse_planner(PRESET, "mine.yaml", sampler, PRESETS)
    assert planner.vehicle == "kingfisher"
    # keys of other samplers are skipped
    own = {"gamma": (3.0, 3.0, 3.0, 2.0)} if sampler == "colored" else {}
    assert planner.sampling == replace(base.sampling, **own)
    assert planner.mppi == replace(base.mppi, samples=2048, target_ess=None)
    assert planner.cost == base.cost


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("base: rase\n", "p.yaml:1:7: base: no preset 'rase': did you mean 'race'?"),
        ("mppi: {samples: 9}\n", "base: missing"),
        ("base: race\nmpi: {samples: 9}\n", "p.yaml:2:1: mpi: unknown key, did you mean 'mppi'?"),
        ("base: race\nmppi: {dt: 1e-2, dt: 2}\n", "mppi.dt: duplicate key"),
        (
            "base: race\nmppi: {samples: 20}\n",
            "p.yaml:2:7: mppi.target_ess: expected less than samples = 20, got 60",
        ),
        (
            "base: race\nsampling: {sigma: [1, 1, 1, 0]}\n",
            "expected a number [rad/s, rad/s, rad/s, m/s^2] > 0",
        ),
        (
            "base: race\nsampling: {sigma: [1, 1, 1]}\n",
            "expected 4 numbers [rad/s, rad/s, rad/s, m/s^2], got 3",
        ),
        ("base: race\nsampling: {gama: [1, 1, 1, 1]}\n", "p.yaml:2:12: sampling.gama: unknown key"),
        (
            "base: race\nsampling: {law: pink}\n",
            "expected 'exact' or 'library' or 'paper', got 'pink'",
        ),
    ],
)
def test_preset_file_errors_name_the_place(text, problem):
    with pytest.raises(FileError) as caught:
        parse_planner(text, "p.yaml", "colored", PRESETS, SYSTEMS["quadrotor"].control_units)
    assert problem in str(caught.value)
