"""Compiled on the spot or loaded from the cache: the same code, the same plan to the last bit."""

import os
import subprocess
import sys

import numpy as np
import pytest

PLANS = """
import sys
import numpy as np
from controllers.costs.race import RaceWeights, race_cost
from controllers.config import MPPIConfig
from controllers.mppi import MPPI
from controllers.samplers import Colored
from quadsim.course import load_course
from quadsim.physics.plant import start_state
from quadsim.dynamics.quadrotor import ModelParams, quadrotor

course, config = load_course("paper_flat"), MPPIConfig(samples=500, horizon=60, target_ess=20.0)
system = quadrotor(ModelParams((0.1, 0.12, 0.2), 0.04, 0.3, (8.0, 8.0, 4.0), 36.0), config.dt)
sampler = Colored((1.5, 1.5, 0.3, 3.0), (0.01, 0.01, 0.01, 0.5))
mppi = MPPI(system, race_cost(course, 0.1, RaceWeights(), 1), sampler, config, seed=int(sys.argv[1]))
x = start_state(course.start, 0.1)
print(mppi.is_cached, file=sys.stderr)
for _ in range(20):
    u, _ = mppi.control(np.array(x))
    x = tuple(float(value) for value in system.next(x, u.tolist()))
sys.stdout.buffer.write(mppi.plan.tobytes())
"""


@pytest.fixture
def plan(tmp_path):
    """plan(seed): bytes of the plan after some flight, and whether nothing had to be compiled for
    it.

    By a process whose caches lie under tmp_path, empty at first.
    """
    env = os.environ | {"XDG_CACHE_HOME": str(tmp_path)}

    def run(seed):
        command = [sys.executable, "-c", PLANS, str(seed)]
        done = subprocess.run(command, env=env, check=True, capture_output=True)
        return done.stdout, done.stderr.strip() == b"True"

    return run


def test_fresh_code_and_code_from_the_cache_plan_alike_to_the_last_bit(plan, tmp_path):
    def compiled():
        return {path.name: path.stat().st_mtime_ns for path in tmp_path.rglob("*.code")}

    (fresh, was_cached), built = plan(1), compiled()
    assert not was_cached
    assert {name.split(".")[1].split("-")[0] for name in built} == {
        "rollout",
        "transformed",
        "_lane_sums",
    }
    assert plan(1) == (fresh, True)
    assert plan(2)[0] != fresh
    assert compiled() == built  # nothing was compiled again
    # a plan, not the rest control
    assert np.ptp(np.frombuffer(fresh).reshape(60, 4), axis=0).min() > 0.1
