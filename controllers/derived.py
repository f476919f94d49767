"""Derive the numbers of the preset `race` from vehicle, course and control period.

The numbers in quadsim.controllers.presets hold for the reference: gates some 10 to 20 m apart
with openings of 1.5 m and more, racing vehicles, a control period of 10 ms. The laws of this module
give other numbers for a flight of another scale. Lengths, times and rates in the planner are scaled
with the flight. Two similar flights therefore have similar plans: if lengths are multiplied by k,
times are multiplied by sqrt(k), and accelerations stay equal, like gravity. docs/derived.md has
each law with its reason, and the flights that show it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import exp, log, log2, sqrt
from typing import Any, NamedTuple

from quadsim.controllers.costs.frames import inner_margin
from quadsim.controllers.costs.race import RaceWeights
from quadsim.controllers.presets import Planner, with_period, with_sight
from quadsim.controllers.samplers import Colored, LogNormal, Sampling, Smooth
from quadsim.controllers.samplers.colored import spectrum
from quadsim.course import Course
from quadsim.course.opening import free_half_sizes
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.vehicle import GRAVITY, Vehicle

# The presets whose numbers are derived
DERIVED = ("race",)
# Ratio of the sight to the time scale. With it lsy_track has the 1 s that were tuned there.
HORIZON = 3.3
# The longest sight [s], which is the sight of the reference. The samples of a longer one would
# spread over a future that changes anyway.
LONGEST = 1.5
# The longest horizon with the term time_to_go [s], which supplies what comes after it
LONGEST_WITH_VALUE = 1.0
# The control period from which on the horizon is as long with the term as without it [s]: it has
# few steps anyway, and by camera at 40 Hz flights with the shorter one crashed.
SLOW_PERIOD = 0.02
# The reference's control period [s], and the number of them in its sight
REFERENCE_PERIOD = 0.01
REFERENCE_STEPS = 150
# The sight is a multiple of this [s]: each horizon has compiled loops of its own.
GRID = 0.5
# The smallest margin, in radii of the vehicle: errors of a flight do not shrink with an opening
MARGIN_RADII = 0.8
# The largest share of half the free opening for the margin, whatever the radius
LARGEST_SHARE = 0.5
# The smallest share with a control period above SLOW_PERIOD: errors grow until the next plan.
SLOW_SHARE = 0.4
# The largest margin as a share of the narrowest half opening; it also bounds that to the ground.
MARGIN_ROOM = 0.7
# A margin of this or more has the weight of the reference [m]; below, weight x margin^2 stays
STEEP_BELOW = 0.12
# Frames are in the way of the samples from this size beside a leg on.
FRAME_SHARE = 0.22
# From this share of a leg on, the way of a point mass between gates leads through frames.
CROWDED_SHARE = 0.42
# Openings are narrow if their room is below this share of a leg. On the courses of the reference it
# is 0.05 and more.
NARROW_SHARE = 0.045
# The narrowness from which on the horizon grows with it
VERY_NARROW = 2.5
# The most samples; more fly hardly faster, see docs/samplers.md
MOST_SAMPLES = 4096
# The nose is turned to each gate if the time scale is at least this many lags of the yaw.
YAW_LAGS = 2.0
# The yaw gain above which there is more noise of yaw. Among the reference's vehicles only cpc has
# more, and its yaw is limited to 0.3 rad/s.
YAW_GAIN = 0.9
# The largest weight of a cost and the largest sigma of a sampler that may be set
LARGEST_WEIGHT = 1e6
LARGEST_SIGMA = 1000.0
# The least cost of yaw that the laws assume [m]; a vehicle without rotors has no cost of yaw.
SMALLEST_YAW_COST = 1e-3
# Smallest room that the laws reckon with [m]: the vehicle may be wider than an opening.
SMALLEST_ROOM = 0.01


class Law(NamedTuple):
    """The result of a law, and its formula with the numbers of the flight."""

    value: Any
    text: str


class Scale(NamedTuple):
    """The properties of a flight from which the numbers are derived."""

    # mean distance between gates, at least the size of a frame [m]
    leg: float
    # horizontal acceleration of level flight at full thrust [m/s^2]
    acceleration: float
    # mean size of the gates with their frames [m]
    frame: float
    # half of the narrowest opening, less radius and safety margin [m]
    room: float
    # of the vehicle [m]
    radius: float
    # lag of the yaw rate, of loop and rotors [s]
    yaw_lag: float
    # angular acceleration about z times the radius, per thrust that the rotors have left for it
    yaw_gain: float
    # ratio of the limits of yaw and roll rate
    yaw_limit: float
    # control period [s]
    period: float
    # whether gates stand off the map and are known only from nearby
    seen_late: bool = False
    # whether the term time_to_go may be used
    may_value: bool = True
    # whether there are obstacles beside the gates
    has_obstacles: bool = False

    @classmethod
    def of(
        cls,
        course: Course,
        vehicle: Vehicle,
        period: float,
        seen_late: bool = False,
        may_value: bool = True,
    ) -> Scale:
        """Return the scale of a flight.

        Args:
            course: the planner's map.
            vehicle: the vehicle.
            period: control period [s].
            seen_late: whether gates are displaced from the map and their true positions seen late.
            may_value: whether the term `time_to_go` may be used; False: its weight was given as 0.
        """
        model = ModelParams.of(vehicle)
        rooms = [
            min(free_half_sizes(gate.opening, vehicle.radius, inner_margin(gate, vehicle.radius)))
            for gate in course.gates
        ]
        frames = [max(gate.opening) + 2 * gate.frame_width for gate in course.gates]
        frame = sum(frames) / len(frames)
        return cls(
            # A lap round a single gate has no length, but leads round the frame.
            leg=max(course.lap_length / len(course.gates), frame),
            frame=frame,
            acceleration=sqrt(vehicle.thrust_max**2 - GRAVITY**2),
            room=max(min(rooms), SMALLEST_ROOM),
            radius=vehicle.radius,
            yaw_lag=model.rate_tau[2] + model.rate_lags[2],
            yaw_gain=vehicle.radius / max(model.yaw_cost, SMALLEST_YAW_COST),
            yaw_limit=model.rate_max[2] / model.rate_max[0],
            period=period,
            seen_late=seen_late,
            may_value=may_value,
            has_obstacles=bool(course.obstacles),
        )

    @property
    def time(self) -> float:
        """The time scale, the square root of a leg's length over the full acceleration [s]."""
        return sqrt(self.leg / self.acceleration)

    @property
    def has_value(self) -> bool:
        """Whether the planner has the term `time_to_go`.

        The point mass of the term knows neither attitude nor frames nor obstacles. Where openings
        are narrow, or frames wide beside the legs, its way is one that the vehicle cannot fly.
        """
        is_in_the_open = self.frame <= CROWDED_SHARE * self.leg and not self.has_obstacles
        return self.may_value and self.narrowness == 1.0 and is_in_the_open

    @property
    def is_shortened(self) -> bool:
        """Whether the horizon is shorter than the sight, as `time_to_go` supplies the rest."""
        return self.has_value and self.period < SLOW_PERIOD

    @property
    def narrowness(self) -> float:
        """The ratio of NARROW_SHARE of a leg to the openings, at least 1."""
        return max(NARROW_SHARE * self.leg / self.room, 1.0)

    @property
    def narrowness_text(self) -> str:
        """The narrowness as text for a formula."""
        return f"({NARROW_SHARE:g} leg {self.leg:.3g} m / {self.room_text})"

    @property
    def room_text(self) -> str:
        """The room as text for a formula."""
        return f"room {self.room:.3g} m"


def derived(reference: Planner, scale: Scale) -> Planner:
    """Return the planner of a flight: the reference's planner with the numbers of its scale.

    At the reference's scale it equals the reference exactly. The horizon counts steps of the
    reference's control period, see `with_period` in quadsim.controllers.presets.

    Args:
        reference: a planner of the preset `race`.
        scale: the scale of the flight.
    """
    assert isinstance(reference.cost, RaceWeights)
    mppi = replace(
        reference.mppi,
        horizon=round(horizon(scale).value / reference.mppi.dt),
        longer_steps=longer_steps(reference.mppi.longer_steps, scale).value,
        samples=samples(reference.mppi.samples, scale).value,
    )
    cost = replace(
        reference.cost,
        margin=margin(reference.cost.margin, scale).value,
        margin_share=margin_share(reference.cost.margin_share, scale).value,
        clearance=clearance(reference.cost, scale).value,
        time_to_go=time_to_go(reference.cost.time_to_go, scale).value,
    )
    planner = replace(
        reference,
        sampling=sampling(reference.sampling, scale),
        mppi=mppi,
        cost=cost,
        view_weight=view_weight(reference.view_weight, scale),
    )
    return with_sight(planner) if scale.seen_late else planner


def sight_law(scale: Scale) -> float:
    """Return the sight as a multiple of the time scale [s].

    The sight is the time ahead that decides the next controls. A racer has to brake or turn for the
    gate after the next one, which takes a time in proportion to the time scale. A very narrow
    opening is approached at less than full acceleration.
    """
    return HORIZON * scale.time * sqrt(max(scale.narrowness / VERY_NARROW, 1.0))


def sight(scale: Scale) -> float:
    """Return the sight of a flight [s], by the law, within limits and on a grid of values."""
    return GRID * max(round(min(sight_law(scale), LONGEST) / GRID), 1)


def horizon(scale: Scale) -> Law:
    """Return the horizon of a flight [s]: its sight, or less with the term `time_to_go`."""
    seconds = sight(scale)
    root = f"leg {scale.leg:.3g} m / {scale.acceleration:.3g} m/s^2"
    if scale.narrowness > VERY_NARROW:
        root = f"{scale.narrowness_text} / {VERY_NARROW:g} {root}"
    limits = f"at most {LONGEST:g} s, to {GRID:g} s: {seconds:g} s"
    if scale.is_shortened:
        seconds = min(seconds, LONGEST_WITH_VALUE)
        limits += f"; at most {LONGEST_WITH_VALUE:g} s with time_to_go"
    return Law(seconds, f"{HORIZON:g} sqrt({root}) = {sight_law(scale):.3g} s, {limits}")


def longer_steps(reference: float | None, scale: Scale) -> Law:
    """Return the time ahead after which steps are longer [s]; None: they are control periods."""
    if scale.is_shortened:
        return Law(reference, "as in the preset, with time_to_go and a short control period")
    return Law(
        None, f"none without time_to_go or with a control period of {SLOW_PERIOD:g} s and more"
    )


def time_to_go(reference: float, scale: Scale) -> Law:
    """Return the weight of the term `time_to_go`.

    It is 0 where the point mass flies a way that the vehicle cannot, see `Scale.has_value`.
    """
    reasons = {
        "the weight was given as 0": not scale.may_value,
        "there are obstacles": scale.has_obstacles,
        f"openings are narrow: {scale.narrowness_text} > 1": scale.narrowness > 1.0,
        f"frames are wide: {scale.frame:.3g} m > {CROWDED_SHARE:g} leg {scale.leg:.3g} m": (
            scale.frame > CROWDED_SHARE * scale.leg
        ),
    }
    found = [reason for reason, holds in reasons.items() if holds]
    if found:
        return Law(0.0, f"0, as {found[0]}")
    return Law(reference, f"{reference:g}, as openings and legs are wide and free of obstacles")


def steps_of(scale: Scale) -> int:
    """Return the number of control periods in the sight of a flight."""
    return round(sight(scale) / scale.period)


def stretch(scale: Scale) -> float:
    """Return the ratio of the reference's sight to the flight's, by which rates are scaled."""
    return LONGEST / sight(scale)


def stretch_text(scale: Scale) -> str:
    """Return the ratio of `stretch` as text for a formula."""
    return f"{LONGEST:g} s / sight {sight(scale):g} s"


def sampling(reference: Sampling, scale: Scale) -> Any:
    """Return the reference's sampler with its noise scaled for a flight.

    Body rates are scaled by the inverse of the sight, so that samples turn by the same angles.
    Thrust is an acceleration, which similar flights share. The cut-off is a fixed number of periods
    within the sight. The noise keeps its density at the low frequencies, which move the vehicle,
    so that the control period does not change the samples there.
    """
    kind: Any = reference
    steps = steps_of(scale)
    gammas = getattr(reference, "gamma", (0.0,) * len(kind.sigma))
    rates = stretch(scale)
    kept = (rates, rates, rates * yaw_factor(kind.sigma, scale), 1.0)
    factors = [by * density(gamma, steps) for by, gamma in zip(kept, gammas, strict=True)]
    if isinstance(reference, Smooth):
        # Its sigma is the derivatives' of the controls, which act for one control period.
        factors = [factor * REFERENCE_PERIOD / scale.period for factor in factors]
    if isinstance(reference, LogNormal):
        pairs = zip(reference.sigma, factors, strict=True)
        return replace(reference, sigma=tuple(log_normal_sigma(s, by) for s, by in pairs))
    pairs = zip(kind.sigma, factors, strict=True)
    sigma = tuple(min(three_digits(s * by), LARGEST_SIGMA) for s, by in pairs)
    changed = replace(kind, sigma=sigma)
    if isinstance(reference, Colored):
        cutoff = tuple(three_digits(rates * f) for f in reference.cutoff or ())
        changed = replace(changed, cutoff=cutoff)
    return changed


def sigma_text(reference: Sampling, scale: Scale) -> str:
    """Return the formula of the noise's standard deviations, see `sampling`, as text."""
    kind: Any = reference
    yaw = f"yaw x {yaw_factor(kind.sigma, scale):.3g}"
    spectra = f"each by its spectrum for {steps_of(scale)} in place of {REFERENCE_STEPS} steps"
    return f"body rates x {stretch_text(scale)}, {yaw}; {spectra}"


def cutoff_text(reference: Colored, scale: Scale) -> str:
    """Return the formula of the noise's cut-off frequencies, see `sampling`, as text."""
    frequencies = " ".join(f"{f:g}" for f in dict.fromkeys(reference.cutoff or ()))
    return f"{frequencies} Hz x {stretch_text(scale)}"


def yaw_factor(sigma: Sequence[float], scale: Scale) -> float:
    """Return the factor on the noise of the yaw rate, in addition to the factor for all rates.

    A race does not need yaw, and rotors near full thrust have no torque for it. A vehicle with
    strong yaw torque uses it if room is short. The noise is at most the same share of the rate's
    limit as the noise of roll.

    Args:
        sigma: standard deviations of the reference.
        scale: the scale of the flight.
    """
    roll, _, yaw, _ = sigma
    return max(min(scale.yaw_gain / YAW_GAIN, roll / yaw * scale.yaw_limit), 1.0)


def density(gamma: float, steps: int) -> float:
    """Return the factor on sigma that keeps the density of the noise at low frequencies.

    sigma^2 is spread over all frequencies of the sight. A sight of fewer steps has fewer
    frequencies, and with the same sigma each of them would have more power.

    Args:
        gamma: exponent of the power spectral density, 0 for white noise.
        steps: number of control periods in the sight.
    """
    least, flown = REFERENCE_STEPS, max(steps, 2)
    return spectrum(2 * least, gamma, "exact")[1] / spectrum(2 * flown, gamma, "exact")[1]


def log_normal_sigma(sigma: float, factor: float) -> float:
    """Return the sigma of log-normal noise whose standard deviation is multiplied by a factor.

    The standard deviation is sigma exp(sigma^2).
    """
    if factor == 1.0:
        return sigma
    wanted = factor * sigma * exp(sigma**2)
    # Newton's method on the logarithm, ln s + s^2 = ln wanted, which is concave and then convex
    found = sigma
    for _ in range(50):
        off = log(wanted) - log(found) - found**2
        found *= exp(off / (1.0 + 2.0 * found**2))
    return three_digits(found)


def three_digits(value: float) -> float:
    """Return a number rounded to three digits, as in preset files."""
    return float(f"{value:.3g}")


def samples(reference: int, scale: Scale) -> Law:
    """Return the number of samples, the reference's number times a power of two.

    Samples turn by the same angles, so they spread in proportion to a leg, and more of them hit a
    frame that is large in comparison. The number grows with the square of this ratio, with the
    square of the narrowness, as an opening has a width and a height, and with the time of a control
    period per step of the sight.
    """
    steps = max(steps_of(scale), 1)
    crowded = max(scale.frame / scale.leg / FRAME_SHARE, 1.0) ** 2
    time = scale.period / REFERENCE_PERIOD * REFERENCE_STEPS / steps
    doublings = round(log2(crowded * scale.narrowness**2 * time))
    value = max(reference, min(reference * 2 ** max(doublings, 0), MOST_SAMPLES))
    share = f"(frame {scale.frame:.3g} m / leg {scale.leg:.3g} m / {FRAME_SHARE:g})^2"
    periods = f"(period {scale.period:g} s / {REFERENCE_PERIOD:g} s)"
    factors = f"{share} {periods} ({REFERENCE_STEPS} / {steps} steps)"
    if scale.narrowness > 1.0:
        factors = f"{scale.narrowness_text}^2 {factors}"
    return Law(value, f"{reference} {factors}, by doubling, at most {MOST_SAMPLES}")


def margin(reference: float, scale: Scale) -> Law:
    """Return the margin [m], which also bounds the margin to the ground.

    It equals the reference's margin, unless the openings are smaller.
    """
    value = min(reference, three_digits(MARGIN_ROOM * scale.room))
    return Law(value, f"{MARGIN_ROOM:g} x {scale.room_text}, at most {reference:g} m")


def margin_share(reference: float, scale: Scale) -> Law:
    """Return the margin as a share of half of the free opening.

    It equals the reference's share, unless the margin would be less than a part of the vehicle's
    radius, or the control period is long.
    """
    usual = max(reference, SLOW_SHARE) if scale.period > SLOW_PERIOD else reference
    least = three_digits(MARGIN_RADII * scale.radius / scale.room)
    value = min(max(usual, least), LARGEST_SHARE)
    share = f"{MARGIN_RADII:g} x radius {scale.radius:g} m / {scale.room_text}"
    return Law(value, f"{share}, from {usual:g} to {LARGEST_SHARE:g}")


def clearance(reference: RaceWeights, scale: Scale) -> Law:
    """Return the weight of the term that keeps the margin.

    The term is the shortfall of the margin times a length, and both scale with the margin. So
    below STEEP_BELOW the weight grows with the inverse square of the margin, and the largest
    value of the weighted term does not change.
    """
    wanted = margin(reference.margin, scale).value
    flown = min(wanted, margin_share(reference.margin_share, scale).value * scale.room)
    steep = max(STEEP_BELOW / flown, 1.0) ** 2
    value = min(three_digits(reference.clearance * steep), LARGEST_WEIGHT)
    usual = f"{reference.clearance:g}"
    ratio = f"({STEEP_BELOW:g} m / margin {flown:.3g} m)^2"
    return Law(value, f"{usual} {ratio}, at least {usual}")


def view_weight(reference: float, scale: Scale) -> float:
    """Return the weight of the view term: 0 if the nose lags behind the gates."""
    return reference if scale.time >= YAW_LAGS * scale.yaw_lag else 0.0


class DerivedNumber(NamedTuple):
    """A derived number of a planner, with its law and the law's inputs."""

    name: str
    value: Any
    law: str


def derivation(reference: Planner, scale: Scale) -> list[DerivedNumber]:
    """Return the numbers that are derived, each with its law and the law's inputs.

    Args:
        reference: a planner of the preset `race`.
        scale: the scale of the flight.
    """
    planner = with_period(derived(reference, scale), scale.period)
    usual = reference.cost
    assert isinstance(usual, RaceWeights)
    texts = {
        "horizon": horizon(scale).text,
        "longer_steps": longer_steps(reference.mppi.longer_steps, scale).text,
        "samples": samples(reference.mppi.samples, scale).text,
        "sigma": sigma_text(reference.sampling, scale),
    }
    if isinstance(reference.sampling, Colored):
        texts["cutoff"] = cutoff_text(reference.sampling, scale)
    texts |= {
        "margin": margin(usual.margin, scale).text,
        "margin_share": margin_share(usual.margin_share, scale).text,
        "clearance": clearance(usual, scale).text,
        "time_to_go": time_to_go(usual.time_to_go, scale).text,
    }
    if scale.seen_late:
        late = "gates stand off the map and are known only from nearby"
        texts |= dict.fromkeys(("first_noise", "news_iterations", "caution"), late)
    numbers = vars(planner.sampling) | vars(planner.mppi) | vars(planner.cost)
    return [
        DerivedNumber(name, numbers[name], law) for name, law in texts.items() if name in numbers
    ]
