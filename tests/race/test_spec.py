"""What is flown: flags, presets and vehicles resolved to one record, which alone decides the flight."""

import json
from dataclasses import replace

import pytest
from quadsim.app.flight_flags import FlightFlags, default_timeout
from quadsim.app.preset_file import parse_planner

from controllers.presets import PRESETS
from quadsim.files.strict_yaml import FileError
from quadsim.race.build import build
from quadsim.race.flight import fly
from quadsim.record.run import Run
from quadsim.systems.quadrotor import ModelParams

SMALL = {"samples": 256, "horizon": 40, "iterations": 1}


def flags(**changes):
    """The main job with a small budget."""
    given = FlightFlags.defaults([])
    return replace(given, mppi=replace(given.mppi, **SMALL), **{"timeout": 0.3, "laps": 1} | changes)


def flown(given) -> Run:
    spec = given.spec()
    plant, controller, referee = build(spec)
    return Run.from_frames(spec.record(), fly(plant, controller, referee, spec.planner.mppi.dt))


@pytest.mark.parametrize("sampler", ["gaussian", "colored"])
def test_same_seed_same_run_to_the_last_bit_with_one_thread_or_two(sampler, on_threads):
    digests = {on_threads(n, lambda n=n: flown(flags(sampler=sampler, threads=n)).digest()) for n in (1, 2, 2)}
    assert len(digests) == 1
    assert flown(flags(sampler=sampler, seed=1)).digest() not in digests, "another seed, another run"


def test_record_is_json_and_holds_every_number():
    record = json.loads(json.dumps(flags().spec().record()))
    assert record["planner"]["mppi"] | SMALL == record["planner"]["mppi"]
    assert record["planner"]["sampling"]["sigma"] == list(PRESETS["race"]["colored"].sampling.sigma)
    assert record["course_text"].startswith("#")
    assert record["vehicle"]["rotors"]["tau"] == 0.033


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("sampler", ["gaussian", "colored"])
def test_defaults_are_the_presets_own(preset, sampler):
    planner = PRESETS[preset][sampler]
    for argv in (["--preset", preset, "--sampler", sampler], [f"--preset={preset}", f"--sampler={sampler}"]):
        assert FlightFlags.defaults(argv).spec().planner == planner


def test_planner_has_the_vehicles_nominal_model_unless_told():
    given = flags()
    own = given.spec()
    assert own.model == ModelParams.of(own.vehicle)
    told = replace(given, model=replace(given.model, drag=0.0)).spec()
    assert told.model == replace(own.model, drag=0.0)


def test_timeout_grows_with_the_laps():
    spec = flags(timeout=None).spec()
    assert spec.timeout == default_timeout(spec.course, 1)
    assert default_timeout(spec.course, 3) - default_timeout(spec.course, 1) == pytest.approx(spec.course.lap_length)


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
    assert planner.vehicle == "kingfisher"
    assert planner.sampling == replace(base.sampling, gamma=(3.0, 3.0, 3.0, 2.0))
    assert planner.mppi == replace(base.mppi, samples=2048, target_ess=None)
    assert planner.cost == base.cost


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("base: rase\n", "p.yaml:1:7: base: no preset 'rase': did you mean 'race'?"),
        ("mppi: {samples: 9}\n", "base: missing"),
        ("base: race\nmpi: {samples: 9}\n", "p.yaml:2:1: mpi: unknown key, did you mean 'mppi'?"),
        ("base: race\nmppi: {dt: 1e-2, dt: 2}\n", "mppi.dt: duplicate key"),
        ("base: race\nmppi: {samples: 20}\n", "p.yaml:2:7: mppi.target_ess: expected less than samples = 20, got 27"),
        ("base: race\nsampling: {sigma: [1, 1, 1, 0]}\n", "expected a number [rad/s, rad/s, rad/s, m/s^2] > 0"),
        ("base: race\nsampling: {sigma: [1, 1, 1]}\n", "expected 4 numbers"),
        ("base: race\nsampling: {law: pink}\n", "expected 'exact' or 'library' or 'paper', got 'pink'"),
    ],
)
def test_preset_file_errors_name_the_place(text, problem):
    with pytest.raises(FileError) as caught:
        parse_planner(text, "p.yaml", "colored")
    assert problem in str(caught.value)
