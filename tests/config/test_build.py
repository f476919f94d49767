"""The parts of a flight fit together from the start."""

from dataclasses import replace

import pytest

from quadsim.config.build import build
from quadsim.config.spec import Spec
from quadsim.controllers.lanes.lanes import Rollout
from quadsim.racing.flight import simulate
from tests.small import SHORT


@pytest.mark.compiled
@pytest.mark.parametrize("settings", [{}, {"adapt": False}, {"sensing": "vio"}])
def test_the_first_plan_uses_the_loop_that_is_looked_for_in_the_cache(settings, monkeypatch):
    """Otherwise each flight says that it compiles, and a race of several compiles twice."""
    # Which loop a plan uses is the claim, so the loop is neither compiled nor run.
    monkeypatch.setattr(Rollout, "__call__", lambda rollout, x0, U, noise, target, J: J.fill(0.0))
    parts = build(Spec.of("figure8", **SHORT, **settings))
    planner = parts.controller.planner
    before = planner.system.step
    frames = simulate(replace(parts, snapshot=None))
    next(frames)
    assert planner.system.step is before
    frames.close()
    parts.plant.close()
