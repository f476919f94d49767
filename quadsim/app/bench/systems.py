"""The systems that `race bench` times, built as the paper's experiments build them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from controllers.config import MPPIConfig
from controllers.mppi import MPPI
from controllers.presets import preset
from controllers.samplers import make_sampler
from quadsim.app.paper import integrator, vehicle
from quadsim.course import load_course
from quadsim.physics.plant import start_state
from quadsim.race.spec import Spec, controller_of, streams
from quadsim.systems.quadrotor import ModelParams
from quadsim.vehicle import load_vehicle

Budget = dict[str, int]  # samples, horizon, iterations
Built = tuple[MPPI, np.ndarray]  # and the state that it plans from


def _quadrotor(sampler: str, budget: Budget) -> Built:
    """On paper_flat, gates and all."""
    paper = preset("paper", sampler)
    course, frame = load_course("paper_flat"), load_vehicle(paper.vehicle)
    planner = replace(paper, mppi=replace(paper.mppi, **budget))
    spec = Spec(course, frame, sampler, "paper", planner, ModelParams.of(frame), 0, 1, 60.0, False, 1 / 400)
    return controller_of(spec, streams(0)[0]), np.array(start_state(course.start, frame.radius))


def _double_integrator(sampler: str, budget: Budget) -> Built:
    """As in Table II at sigma 1.5, with the exact law where the sampler is colored."""
    sampling = make_sampler(sampler, sigma=(1.5, 1.5), gamma=(1.0, 1.0))
    return integrator.controller(sampling, replace(integrator.MPPI_CONFIG, **budget)), np.array(integrator.START)


def _offroad(sampler: str, budget: Budget) -> Built:
    """At the start of the corridor, standing."""
    return vehicle.controller(sampler, replace(vehicle.MPPI_CONFIG, **budget)), np.array(vehicle.start())


# name -> the paper's budget, controller at any budget and the state that it plans from
SYSTEMS: dict[str, tuple[MPPIConfig, Callable[[str, Budget], Built]]] = {
    "quadrotor": (preset("paper", "gaussian").mppi, _quadrotor),
    "double_integrator": (integrator.MPPI_CONFIG, _double_integrator),
    "offroad": (vehicle.MPPI_CONFIG, _offroad),
}
