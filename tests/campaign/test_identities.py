"""Different flights have different keys: none is reported under the name of another."""

import os
import subprocess
import sys
import threading
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from campaign_cases import COURSE, SETTINGS

import quadsim
from controllers.learned.pilot import PILOTS
from quadsim.campaign.store import Store
from quadsim.record.limits import SOLUTIONS
from quadsim.spec.settings import SettingError

ROOT = Path(quadsim.__file__).parents[1]
TINY = {name: value for name, value in SETTINGS.items() if name != "preset"}


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
    found[19, 19] = tail
    return found


PAIRS = {
    "matrices of one shape": ({"sampler": Matrix(matrix(1.0))}, {"sampler": Matrix(matrix(3.0))}),
    "held closures": ({"sampler": Shaped(times(1.0))}, {"sampler": Shaped(times(2.0))}),
    "functions of the cost": ({"cost": dearer(1.5)}, {"cost": dearer(0.1)}),
    "slots": ({"sampler": Slotted(1.0)}, {"sampler": Slotted(2.0)}),
    "states that cannot be told": ({"sampler": Locked(1.0)}, {"sampler": Locked(2.0)}),
}


def digests(comparison):
    """Return the digest of each variant's first flight."""
    (section,) = comparison.sections
    return [rows[0].result["digest"] for rows in section.rows]


@pytest.mark.parametrize("what", PAIRS)
def test_two_different_objects_of_one_call_are_two_variants(what):
    one, other = PAIRS[what]
    found = quadsim.compare(COURSE, {"one": one, "other": other}, 1, preset="paper", **TINY)
    first, second = digests(found)
    assert first != second
    alone = quadsim.compare(COURSE, {"other": other}, 1, preset="paper", **TINY)
    if what != "states that cannot be told":
        assert digests(alone) == [second], "the second variant flew its own object"


def test_equal_objects_are_not_merged_either_and_fly_alike():
    variants = {"one": {"sampler": Slotted(1.0)}, "other": {"sampler": Slotted(1.0)}}
    found = quadsim.compare(COURSE, variants, 1, preset="paper", **TINY)
    assert [variant.attempts for variant in found.variants] == [1, 1]
    one, other = digests(found)
    assert one == other


def test_an_attempt_does_not_depend_on_those_before_it():
    """A part that counts its own calls begins anew with each attempt, as in a worker process."""
    both = quadsim.compare(COURSE, {"a": {"sampler": Counting()}}, 2, preset="paper", **TINY)
    settings = TINY | {"seed": 1}
    second = quadsim.compare(COURSE, {"a": {"sampler": Counting()}}, 1, preset="paper", **settings)
    (section,) = both.sections
    assert section.rows[0][1].result["digest"] == digests(second)[0]


def flown(campaign):
    """Return the number of flights that a campaign keeps."""
    with Store(campaign) as store:
        return len(store.rows())


def test_a_campaign_flies_an_edited_part_again_and_the_same_part_not(tmp_path):
    campaign = tmp_path / "c.sqlite"

    def run(**own):
        variants = {"mine": own}
        return digests(
            quadsim.compare(COURSE, variants, 1, campaign=campaign, preset="paper", **TINY)
        )

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
        match=r"^campaign: expected a sampler that can be told from others, got Locked.lock: the",
    ) as error:
        quadsim.compare(COURSE, variants, 1, campaign=tmp_path / "c", preset="paper", **TINY)
    assert "\n" not in str(error.value)


def test_another_pilot_of_one_name_is_flown_again(tmp_path):
    campaign = tmp_path / "c.sqlite"
    file = tmp_path / "mine.npz"
    arrays = dict(np.load(PILOTS / "split_s_swift.npz"))

    def run():
        np.savez(file, **arrays)
        variants = {"mine": {"pilot": str(file)}}
        found = quadsim.compare("split_s_swift", variants, 1, campaign=campaign, timeout=0.3)
        return digests(found)

    first = run()
    assert run() == first
    arrays["layer_5"][0] += np.float32(0.1)
    assert run() != first
    assert flown(campaign) == 2


def test_another_solution_of_one_race_is_flown_again(tmp_path, monkeypatch):
    campaign = tmp_path / "c.sqlite"
    (source,) = SOLUTIONS.glob("split_s_swift_swift_3_rates_margin*.npz")
    monkeypatch.setattr("quadsim.record.limits.SOLUTIONS", tmp_path / "none")
    limits = tmp_path / "limits"
    limits.mkdir()
    arrays = dict(np.load(source))

    def run():
        np.savez_compressed(limits / source.name, **arrays)
        settings = {"runs_dir": str(tmp_path), "samples": 64, "timeout": 0.2}
        variants = {"informed": {"preset": "race_informed"}}
        found = quadsim.compare("split_s_swift", variants, 1, campaign=campaign, **settings)
        return digests(found)

    first = run()
    assert run() == first
    arrays["x"][:, 2] -= np.float32(0.05)
    assert run() != first
    assert flown(campaign) == 2


SCRIPT = """
import quadsim

class Held:
    gain = 1.0
    def sample(self, rng, samples, horizon, controls):
        return self.gain * rng.standard_normal((samples, horizon, controls))

if __name__ == "__main__":
    Held.gain = GAIN
    settings = dict(preset="paper", samples=64, horizon=20, iterations=1, timeout=0.1)
    variants = {"mine": {"sampler": Held()}}
    print(quadsim.compare("paper_flat", variants, 1, jobs=1, campaign="c.sqlite", **settings))
"""


def test_a_worker_that_lacks_what_the_script_has_set_is_refused(tmp_path):
    def done(gain):
        script = tmp_path / "script.py"
        script.write_text(SCRIPT.replace("GAIN", gain))
        command = [sys.executable, str(script)]
        env = os.environ | {"PYTHONPATH": str(ROOT)}
        return subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True)

    refused = done("3.0")
    assert refused.returncode == 1
    assert "mine: a worker flies with another sampler than this process has" in refused.stderr
    flown_as_imported = done("1.0")
    assert flown_as_imported.returncode == 0, flown_as_imported.stderr
    assert flown(tmp_path / "c.sqlite") == 1
