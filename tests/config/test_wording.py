"""Claims about the texts that fly a recorded flight again."""

import json
import shlex
from dataclasses import replace

import pytest

import quadsim
from quadsim.cli.cli import race
from quadsim.config.changes import changeable_numbers
from quadsim.config.spec import Spec
from quadsim.record.archive import list_runs, read_run
from quadsim.record.run import hostless, same_flight
from quadsim.record.schema import NumberChange
from quadsim.tables.wording import settings_of, wording
from tests.small import SHORT

FLIGHTS = {
    "a preset's": {"course": "figure8"},
    "own numbers": {
        "course": "split_s_swift",
        "sampler": "gaussian",
        "sigma": (1, 1, 0.1, 4),
        "target_ess": 200,
        "model_drag": 0.0,
        "randomize": 1.0,
        "seed": 7,
    },
    "a stronger vehicle": {"course": "figure8", "vehicle": "swift-twr6", "penalties": True},
    "a pilot on sensors": {"course": "split_s_swift", "pilot": "split_s_swift", "sensing": "gates"},
    "faults on a link": {
        "course": "figure8",
        "fault": ("rotor2=.5@3.2", "commands=lost@2~.1"),
        "link_hz": 100,
        "link_loss": 0.1,
    },
    "no smoothing": {"course": "figure8", "smooth": False, "preset": "paper"},
}


def stored(spec):
    """Return the record of a spec as a file holds it."""
    return json.loads(json.dumps(spec.record()))


@pytest.mark.parametrize("settings", FLIGHTS.values(), ids=FLIGHTS)
def test_the_python_gives_the_recorded_flight(settings, tmp_path):
    record = stored(Spec.of(**settings))
    text = wording(record, tmp_path).python
    found = {}
    exec(text.replace("quadsim.fly(", "quadsim.Spec.of("), found)
    assert hostless(stored(found["run"])) == hostless(record)


@pytest.mark.compiled
def test_the_command_flies_the_same_bits(tmp_path, capsys):
    course = {"sampler": "gaussian", "sigma": (1, 1, 0.1, 4), "fault": "rotor2=.5@.2"}
    run = quadsim.fly("figure8", **SHORT, **course)
    folder = run.save(tmp_path / "runs")
    words = shlex.split(wording(read_run(folder).spec, folder).command)
    assert words[:3] == ["race", "fly", "figure8"]
    race([*words[1:], "--runs-dir", str(tmp_path / "again")])
    capsys.readouterr()
    (again,) = list_runs(tmp_path / "again")
    assert read_run(again).digest() == run.digest()


def test_what_settings_cannot_give_names_the_folder(tmp_path):
    spec = Spec.of("figure8", **SHORT)
    after = replace(spec.planner.mppi, temperature=2.0)
    numbers = changeable_numbers(replace(spec.planner, mppi=after))
    change = NumberChange(0.1, "temperature", 1.0, 2.0, numbers)
    changed = replace(spec, changes=(change,))
    mine = tmp_path / "mine.yaml"
    mine.write_text(spec.course.text)
    for record in (stored(changed), stored(Spec.of(str(mine), **SHORT))):
        assert settings_of(record) is None
        texts = wording(record, tmp_path / "run 1")
        assert shlex.split(texts.command) == ["race", "fly", "--from", str(tmp_path / "run 1")]
        assert f"quadsim.load_run({str(tmp_path / 'run 1')!r})" in texts.python


@pytest.mark.compiled
def test_the_command_of_a_run_on_a_course_of_ones_own_flies_the_same_bits(tmp_path, capsys):
    mine = tmp_path / "mine.yaml"
    mine.write_text(Spec.of("figure8").course.text)
    run = quadsim.fly(str(mine), **SHORT, sampler="gaussian")
    folder = run.save(tmp_path / "runs")
    mine.unlink()
    words = shlex.split(wording(read_run(folder).spec, folder).command)
    race([*words[1:], "--runs-dir", str(tmp_path / "again")])
    capsys.readouterr()
    # it is stored in the folder that the flags name
    again = [read_run(path) for path in list_runs(tmp_path / "again")]
    assert [same_flight(one, run) for one in again] == [True]
