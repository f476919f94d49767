"""Different flights have different keys: none is reported under the name of another."""

import os
import subprocess
import sys
import threading
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import quadsim
from quadsim.campaign.run.attempt import attempt_key
from quadsim.campaign.run.store import Store
from quadsim.config.settings import SettingError
from quadsim.config.spec import Spec
from quadsim.controllers.learned.pilot import PILOTS
from quadsim.limit.limits import SOLUTIONS, dump, load
from tests.campaign_cases import COURSE, SETTINGS

ROOT = Path(quadsim.__file__).parents[1]


class Matrix:
    """A sampler that multiplies white noise by a large matrix."""

    def __init__(self, matrix):
        self.matrix = matrix

    def sample(self, rng, samples, horizon, controls):
        noise = rng.standard_normal((samples, horizon, controls))
        return np.einsum("ts,nsc->ntc", self.matrix[:horizon, :horizon], noise)


class Slotted:
    """A sampler whose number lies in a slot."""

    __slots__ = ("sigma",)

    def __init__(self, sigma):
        self.sigma = sigma

    def sample(self, rng, samples, horizon, controls):
        return self.sigma * rng.standard_normal((samples, horizon, controls))


@dataclass(frozen=True)
class Shaped:
    """A sampler that holds a function."""

    shape: object

    def sample(self, rng, samples, horizon, controls):
        return self.shape(rng.standard_normal((samples, horizon, controls)))


class Locked(Slotted):
    """A sampler with a state that cannot be told."""

    __slots__ = ("lock",)

    def __init__(self, sigma):
        super().__init__(sigma)
        self.lock = threading.Lock()


class Counting:
    """A sampler whose noise grows with each of its plans."""

    def __init__(self):
        self.plans = 0

    def sample(self, rng, samples, horizon, controls):
        self.plans += 1
        return 0.1 * self.plans * rng.standard_normal((samples, horizon, controls))


def times(factor):
    """Return a closure that multiplies."""
    return lambda noise: factor * noise


def dearer(factor):
    """Return a function that multiplies the weights of a cost."""

    def changed(cost):
        return replace(cost, terms=tuple(t.but(weight=factor * t.weight) for t in cost.terms))

    return changed


def matrix(tail):
    """Return a matrix whose last used row differs."""
    found = np.eye(150)
    last = SETTINGS["horizon"] - 1
    found[last, last] = tail
    return found


PAIRS = {
    "matrices of one shape": ({"sampler": Matrix(matrix(1.0))}, {"sampler": Matrix(matrix(3.0))}),
    "held closures": ({"sampler": Shaped(times(1.0))}, {"sampler": Shaped(times(2.0))}),
    "functions of the cost": ({"cost": dearer(1.5)}, {"cost": dearer(0.1)}),
    "slots": ({"sampler": Slotted(1.0)}, {"sampler": Slotted(2.0)}),
    "states that cannot be told": ({"sampler": Locked(1.0)}, {"sampler": Locked(2.0)}),
}


def digests(variants, **settings):
    """Fly these variants once each. Return the digest of each flight."""
    comparison = quadsim.compare(COURSE, variants, 1, **SETTINGS, **settings)
    (section,) = comparison.sections
    return [rows[0].result["digest"] for rows in section.rows]


@pytest.mark.compiled
def test_two_different_objects_of_one_call_are_two_variants():
    for what, (one, other) in PAIRS.items():
        first, second = digests({"one": one, "other": other})
        assert first != second, what
        if what != "states that cannot be told":
            assert digests({"other": other}) == [second], f"{what}: it flew its own object"


@pytest.mark.compiled
def test_equal_objects_are_not_merged_either_and_fly_alike():
    variants = {"one": {"sampler": Slotted(1.0)}, "other": {"sampler": Slotted(1.0)}}
    one, other = digests(variants)
    assert one == other


@pytest.mark.compiled
def test_an_attempt_does_not_depend_on_those_before_it():
    """A part that counts its own calls begins anew with each attempt, as in a worker process."""
    both = quadsim.compare(COURSE, {"a": {"sampler": Counting()}}, 2, **SETTINGS)
    (section,) = both.sections
    second = digests({"a": {"sampler": Counting()}}, seed=1)
    assert [section.rows[0][1].result["digest"]] == second


def flown(campaign):
    """Return the number of flights that a campaign keeps."""
    with Store(campaign) as store:
        return len(store.rows())


@pytest.mark.compiled
def test_a_campaign_flies_an_edited_part_again_and_the_same_part_not(tmp_path):
    campaign = tmp_path / "c.sqlite"

    def run(**own):
        return digests({"mine": own}, campaign=campaign)

    first = run(sampler=Shaped(times(1.0)))
    assert run(sampler=Shaped(times(1.0))) == first
    assert flown(campaign) == 1
    assert run(sampler=Shaped(times(2.0))) != first
    assert flown(campaign) == 2
    code = Slotted.sample
    try:
        before = run(sampler=Slotted(1.0))
        Slotted.sample = lambda self, rng, m, t, n: 2 * code(self, rng, m, t, n)
        assert run(sampler=Slotted(1.0)) != before
    finally:
        Slotted.sample = code
    assert flown(campaign) == 4


def test_a_campaign_refuses_a_part_that_cannot_be_told(tmp_path):
    variants = {"mine": {"sampler": Locked(1.0)}}
    with pytest.raises(
        SettingError,
        match=r"^campaign: expected a sampler that can be told from others, got Locked: its ",
    ) as error:
        quadsim.compare(COURSE, variants, 1, campaign=tmp_path / "c", **SETTINGS)
    assert "\n" not in str(error.value)


def test_another_pilot_or_solution_of_one_name_is_another_attempt(tmp_path, monkeypatch):
    """It is known by what is in its file."""
    (solution,) = SOLUTIONS.glob("split_s_swift_swift_3_rates_margin*.npz")
    monkeypatch.setattr("quadsim.limit.limits.SOLUTIONS", tmp_path / "none")
    (tmp_path / "limits").mkdir()

    def pilot(moved):
        arrays = dict(np.load(PILOTS / "split_s_swift.npz"))
        arrays["layer_5"][..., 0] += np.float32(moved)
        np.savez_compressed(tmp_path / "mine.npz", **arrays)
        return {"pilot": str(tmp_path / "mine.npz")}

    def informed(moved):
        nodes = load(solution).solution
        stored = replace(load(solution), solution=replace(nodes, x=nodes.x + moved))
        (tmp_path / "limits" / solution.name).write_bytes(dump(stored))
        return {"preset": "race_informed", "runs_dir": str(tmp_path)}

    for written in (pilot, informed):
        first, again, other = (
            attempt_key(Spec.of("split_s_swift", **written(moved)).record())
            for moved in (0.0, 0.0, 0.01)
        )
        assert first == again
        assert first != other


SCRIPT = """
import quadsim
from quadsim.record.run import RunError

class Held:
    gain = 1.0
    def sample(self, rng, samples, horizon, controls):
        return self.gain * rng.standard_normal((samples, horizon, controls))

def compare(gain):
    Held.gain = gain
    variants = {"mine": {"sampler": Held()}}
    quadsim.compare("paper_flat", variants, 1, jobs=1, campaign="c.sqlite", **SETTINGS)

if __name__ == "__main__":
    try:
        compare(3.0)
    except RunError as error:
        print(error)
    compare(1.0)
"""


@pytest.mark.regression
def test_a_worker_that_lacks_what_the_script_has_set_is_refused(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.replace("SETTINGS", repr(SETTINGS)))
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    (refused,) = done.stdout.splitlines()
    assert refused.startswith("mine: a worker flies with another sampler than this process has")
    assert flown(tmp_path / "c.sqlite") == 1, "the worker flies what it has imported"
