"""Compiled on the spot or loaded from the cache: the same code, the same plan to the last bit."""

import os
import subprocess
import sys

import numpy as np
import pytest

# It compiles all loops of a planner. That code is kept and found again is claimed of a
# small function in test_code_cache.
pytestmark = pytest.mark.regression
PLANS = """
import sys
import numpy as np
from quadsim.controllers.costs.race import RaceWeights, race_cost
from quadsim.controllers.config import MPPIConfig
from quadsim.controllers.mppi import MPPI
from quadsim.controllers.samplers import Colored
from quadsim.course import load_course
from quadsim.physics.plant import start_state
from quadsim.dynamics.quadrotor import ModelParams, quadrotor

course = load_course("paper_flat")
config = MPPIConfig(samples=500, horizon=60, target_ess=20.0)
system = quadrotor(ModelParams((0.1, 0.12, 0.2), 0.04, 0.3, (8.0, 8.0, 4.0), 36.0), config.dt)
sampler = Colored((1.5, 1.5, 0.3, 3.0), (0.01, 0.01, 0.01, 0.5))
for seed in map(int, sys.argv[1:]):
    mppi = MPPI(system, race_cost(course, 0.1, RaceWeights(), 1), sampler, config, seed)
    print(mppi.is_cached, file=sys.stderr)
    x = start_state(course.start, 0.1)
    for _ in range(20):
        u, _ = mppi.control(np.array(x))
        x = tuple(float(value) for value in system.next(x, u.tolist()))
    sys.stdout.buffer.write(mppi.plan.tobytes())
"""
SHAPE = (60, 4)  # of a plan


@pytest.fixture
def plans(tmp_path):
    """plans(*seeds): plans after some flight, and whether each found its code in the cache.

    They come from one process, whose cache lies under tmp_path and is empty at first.
    """
    env = os.environ | {"XDG_CACHE_HOME": str(tmp_path)}

    def run(*seeds):
        command = [sys.executable, "-c", PLANS, *map(str, seeds)]
        done = subprocess.run(command, env=env, check=True, capture_output=True)
        was_cached = [word == "True" for word in done.stderr.decode().split()]
        return np.frombuffer(done.stdout).reshape(-1, *SHAPE), was_cached

    return run


def test_fresh_code_and_code_from_the_cache_plan_alike_to_the_last_bit(plans, tmp_path):
    def compiled():
        return {path.name: path.stat().st_mtime_ns for path in tmp_path.rglob("*.code")}

    fresh, was_cached = plans(1)
    built = compiled()
    assert was_cached == [False]
    functions = {name.split(".")[1].split("-")[0] for name in built}
    # those of the helping threads are compiled where there is more than one core
    assert functions - {"run_parts", "help_callers"} == {"rollout", "transformed", "_lane_sums"}

    again, was_cached = plans(1, 2)
    assert was_cached == [True, True]
    np.testing.assert_array_equal(again[0], fresh[0])
    assert not np.array_equal(again[1], fresh[0])
    assert compiled() == built, "nothing was compiled again"
    assert np.ptp(fresh[0], axis=0).min() > 0.1, "a plan, not the rest control"
