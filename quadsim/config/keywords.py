"""The keywords of `quadsim.fly`, for editors and type checkers.

Written by `python -m quadsim.tables.write_keywords`; quadsim.config.settings explains each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypedDict

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from quadsim.config.competition import Competition
    from quadsim.config.spec import Spec
    from quadsim.controllers.costs import Cost, Term
    from quadsim.controllers.learned.pilot import Pilot
    from quadsim.controllers.presets import Planner
    from quadsim.controllers.samplers import PlainSampler, Sampling
    from quadsim.course import Course
    from quadsim.dynamics.quadrotor import ModelParams
    from quadsim.firmware.text import Text
    from quadsim.physics.plant import Plant, PlantName
    from quadsim.physics.randomization_file import RandomizationRanges
    from quadsim.racing.flight import ControlLaw, Controller, RefereeProtocol
    from quadsim.sensing import Sensing
    from quadsim.vehicle import Vehicle

    CourseLike = str | Path | Course
    Numbers = Sequence[float] | NDArray[Any]


class Keywords(TypedDict, total=False):
    """The settings by name. `Spec.of` takes the same keywords.

    None stands for the default. It switches off a number of the planner that can be off, such as
    `cutoff` and `target_ess`.
    """

    sampler: str | Sampling | PlainSampler | None
    pilot: str | Path | Pilot | None
    controller: str | Controller | ControlLaw | Callable[[Spec], Controller | ControlLaw] | None
    preset: str | Path | None
    competition: str | Path | Competition | None
    vehicle: str | Path | Vehicle | None
    thrust_to_weight: float | None
    laps: int | None
    timeout: float | None
    sensing: str | Path | Sensing | None
    randomization: str | Path | RandomizationRanges | None
    view_weight: float | None
    plant: PlantName | Plant | Callable[[Spec], Plant] | None
    betaflight: str | Path | Text | None
    term: str | Sequence[str] | None
    seed: int | None
    randomize: float | None
    displace_gates: float | None
    map_scale: float | None
    known_from: float | None
    fault: str | Sequence[str] | None
    excite: bool | None
    penalties: bool | None
    plant_dt: float | None
    flight_controller: Literal["betaflight", "ideal"] | None
    link_hz: float | None
    link_latency: float | None
    link_loss: float | None
    link_burst: float | None
    predict: bool | None
    clock: Literal["simulated", "wall"] | None
    deadline_ms: float | None
    threads: int | None
    blackbox: str | None
    record_sensing: bool | None
    runs_dir: str | Path | None
    sigma: Numbers | None
    gamma: Numbers | None
    law: Literal["exact", "library", "paper"] | None
    cutoff: Numbers | None
    shift: Literal["corrected", "published"] | None
    samples: int | None
    horizon: int | None
    iterations: int | None
    first_iterations: int | None
    news_iterations: int | None
    dt: float | None
    temperature: float | None
    step_size: float | None
    rest_fraction: float | None
    tighten: float | None
    overshoot: float | None
    first_noise: float | None
    cost_rise: float | None
    adapt: bool | None
    longer_steps: float | None
    freeze_first: bool | None
    smooth: bool | None
    target_ess: float | None
    progress: float | None
    heading: float | None
    height: float | None
    speed: float | None
    stabilize: float | None
    crash: float | None
    waypoint: float | None
    path: float | None
    clearance: float | None
    caution: float | None
    time_to_go: float | None
    desired_speed: float | None
    waypoint_radius: float | None
    margin: float | None
    margin_share: float | None
    opening: float | None
    off_path: float | None
    at_gates: float | None
    velocity: float | None
    ahead: float | None
    reserve: float | None
    model_rate_tau: Numbers | None
    model_motor_tau: float | None
    model_drag: float | None
    model_rate_max: Numbers | None
    model_thrust_max: float | None
    model_thrust_min: float | None
    model_tilt_cost: Numbers | None
    model_yaw_cost: float | None
    model_thrust_gain: float | None
    model_tilt_first: bool | None
    model_yaw_first: bool | None
    model_rate_lag: Numbers | None
    model_delay: float | None
    planner: Planner | None
    model: ModelParams | None
    terms: Sequence[Term | tuple[Callable[..., Any], float | NDArray[Any]]] | None
    cost: Cost | Callable[[Cost], Cost] | None
    referee: RefereeProtocol | Callable[[Spec], RefereeProtocol] | None
