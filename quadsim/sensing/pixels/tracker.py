"""The tracker, which finds corners of gates in a picture near their predicted positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from quadsim.course import Gate
from quadsim.rotation import Vec3
from quadsim.sensing.camera import NEAREST, BodyPose, CameraPose
from quadsim.sensing.config import PixelCameraConfig
from quadsim.sensing.measurements import Corners, Photo
from quadsim.sensing.pixels.edges import (
    EDGES,
    Frames,
    Points,
    seen_well,
    taken,
    visible_points,
)
from quadsim.sensing.pixels.hypotheses import best_pose
from quadsim.sensing.pixels.lines import Lines, corners, lines, without
from quadsim.sensing.pixels.network import FoundGate, load_network
from quadsim.sensing.pixels.network_pose import NOISE, Place, all_matched, explained
from quadsim.sensing.pixels.pose_fit import (
    Guess,
    fitted,
    guess_of,
    line_ends,
    normal_moves,
    pose_covariance,
)
from quadsim.sensing.pixels.signal import ORANGE, Signal, Steps, steps
from quadsim.sensing.state import FilterState

# [px] least and largest distance from the expected place at which an edge is searched for. If it
# may be farther away, other poses are tried first.
LEAST = 5.0
LARGEST = 60.0
# number of standard deviations within which an edge is searched for, and an added distance [px]
WITHIN = 3.0
STEADY = 2.0
# [m] distance of gates if none is expected in the picture
TYPICAL = 10.0
# A gate is looked for by the network if it is nearer than WANTED [m], if at least IN_VIEW of its
# corners are in view, and if the edges give fewer than ENOUGH of them.
WANTED = 15.0
IN_VIEW = 3
ENOUGH = 2
# [px] reach of the search after that
FOUND_REACH = 10.0
# largest number of further searches around a fitted pose; [px] if the median reach is below, no
# further search is made
AGAIN = 2
NARROW = 8.0
# [px] A line is left out if one of its ends is farther from the fitted pose's prediction.
WRONG = 3.0
# [px] least distance of a point on an edge from the border of the picture
BORDER = 4.0


class Tracked(NamedTuple):
    """Points, lines and corners that were found in a picture, for figures and tests."""

    points: Points
    # the step found at each point, and whether it belongs to a line
    steps: Steps
    used: np.ndarray
    # expected and found corners [px]  (n, 2)
    expected: np.ndarray
    found: Corners
    # whether other poses were tried first
    searched: bool


class FoundLines(NamedTuple):
    """The steps and lines that a search for edges has found."""

    steps: Steps
    lines: Lines
    # which points belong to a line  (n,)
    used: np.ndarray


class Tracker:
    """Finds gates in pictures."""

    def __init__(self, config: PixelCameraConfig, gates: Sequence[Gate]):
        """Prepare a tracker for a camera and a map.

        Args:
            config: the camera.
            gates: the distinct gates of the map.
        """
        self._config = config
        self._frames = Frames(gates)
        self._signal = Signal(ORANGE)
        self._network = load_network(config.network) if config.network else None

    def __call__(self, photo: Photo, state: FilterState, rates: Vec3) -> Corners:
        """Return the corners found in a picture.

        Args:
            photo: the picture.
            state: the filter's state at the time of the picture.
            rates: body rates at the time of the picture [rad/s].
        """
        return self.tracked(photo, state, rates).found

    def tracked(self, photo: Photo, state: FilterState, rates: Vec3) -> Tracked:
        """Return the corners found in a picture, with the points and lines that led to them."""
        config = self._config
        frames = self._frames.moved(state.gates) if len(state.gates) else self._frames
        signal = self._signal.of(photo.rgb)
        found_gates: list[FoundGate] | None = None
        guess = guess_of(state, len(frames.centre))
        points, reach = self._expected(frames, guess)
        searched = bool(np.median(reach) > LARGEST)
        if searched:
            best = None
            if self._network:
                found_gates = self._network(photo.rgb)
                place = self._place(frames, guess.pose, state, rates)
                best = explained(found_gates, place)
            # Without a network, or if its gates show no pose, the picture itself is compared.
            if best is None:
                error = best_pose(signal, frames, config, guess.pose, guess.P)
            else:
                error = best.error
            guess = guess.corrected(error, guess.P)
            points, _ = self._expected(frames, guess)
            reach = np.full(1, FOUND_REACH)

        # The lines of all gates correct the pose, around which a narrower search finds others.
        # Lines that contradict the rest are left out.
        seen = self._seen(signal, points, reach, guess, state, rates)
        for again in range(AGAIN + 1):
            ends = line_ends(points, seen.used)
            shift = seen.steps.shift[ends]
            fit = fitted(guess, config, taken(points, ends), shift)
            if again == AGAIN or np.median(reach) < NARROW:
                off = abs(shift - fit.moves)
                break
            guess = fit.guess
            points, reach = self._expected(frames, guess)
            seen = self._seen(signal, points, reach, guess, state, rates)
        bad = off > WRONG
        found = without(seen.lines, points.gate[ends[bad]], points.edge[ends[bad]])

        view = config.carried(guess.pose)
        moved = corners(found, points, self._ends(frames, view))
        expected, depth = config.to_pixels(view.local(frames.corners[moved.gate, moved.corner]))
        ahead = depth > NEAREST
        pixels = expected + moved.shift
        result = Corners(
            photo.t,
            gates=moved.gate[ahead],
            corners=moved.corner[ahead],
            pixels=pixels[ahead],
            in_view=self._in_view(frames, view),
            variance=moved.variance[ahead],
        )
        if self._network and self._lacking(result, frames, view):
            if found_gates is None:
                found_gates = self._network(photo.rgb)
            place = self._place(frames, guess.pose, state, rates)
            result = self._filled(
                result, found_gates, frames, place, min(float(reach.max()), LARGEST)
            )
        return Tracked(points, seen.steps, seen.used, expected[ahead], result, searched)

    def _place(
        self,
        frames: Frames,
        pose: BodyPose,
        state: FilterState,
        rates: Vec3,
    ) -> Place:
        """Return a pose with a state's covariance, and the corners that it predicts.

        Args:
            frames: the frames of the map.
            pose: pose of the vehicle.
            state: the filter's state, for its velocity and covariance.
            rates: body rates [rad/s].
        """
        corners = frames.corners.reshape(-1, 3)
        pixel, depth = self._config.to_pixels(self._config.carried(pose).local(corners))
        pixel[depth < NEAREST] = np.nan
        number = np.zeros(len(corners), int)
        points = Points(number, number, corners, pixel, pixel, np.zeros(len(corners)))
        late = self._late(points, pose, np.array(state.nominal.velocity), rates)
        P = pose_covariance(state)
        return Place(frames, self._config, pose, P, np.nan_to_num(late))

    def _filled(
        self, corners: Corners, found: list[FoundGate], frames: Frames, place: Place, near: float
    ) -> Corners:
        """Return corners, with the network's corners for gates that lack them.

        Args:
            corners: corners where edges meet.
            found: gates that the network has found.
            frames: the frames of the map.
            place: the pose, which predicts the corners of each gate.
            near: largest distance of a corner from its predicted pixel [px].
        """
        matched = all_matched(found, *place.pixels(np.zeros(6)), near)
        gates = len(frames.centre)
        lacks = np.bincount(corners.gates, minlength=gates) < ENOUGH
        shown = np.bincount(matched.gate, minlength=gates) >= ENOUGH
        more = (lacks & shown)[matched.gate]
        if not more.any():
            return corners
        # A corner that the edges show as well counts once.
        keep = ~(lacks & shown)[corners.gates]
        at = matched.pixel - place.late[matched.gate, matched.corner]
        # The edges determine a corner to some tenths of a pixel, the network to NOISE.
        variance = np.zeros(len(keep)) if corners.variance is None else corners.variance
        others = np.full(more.sum(), NOISE**2)
        return replace(
            corners,
            gates=np.concatenate([corners.gates[keep], matched.gate[more]]),
            corners=np.concatenate([corners.corners[keep], matched.corner[more]]),
            pixels=np.concatenate([corners.pixels[keep], at[more]]),
            variance=np.concatenate([variance[keep], others]),
        )

    def _lacking(self, corners: Corners, frames: Frames, view: CameraPose) -> bool:
        """Return whether too few corners of a gate that the camera should see are found."""
        points = frames.corners.reshape(-1, 3)
        pixels, depth = self._config.to_pixels(view.local(points))
        gates = len(frames.centre)
        own = np.repeat(np.arange(gates), 4)
        seen = self._config.in_picture(pixels) & (depth > NEAREST)
        seen &= ~frames.hide(points, own, view.eye)
        wanted = np.bincount(own[seen], minlength=gates) >= IN_VIEW
        wanted &= seen_well(frames, view, WANTED)
        return bool((wanted & (np.bincount(corners.gates, minlength=gates) < ENOUGH)).any())

    def _expected(self, frames: Frames, guess: Guess) -> tuple[Points, np.ndarray]:
        """Return points on edges, and the distance within which each edge is searched for [px].

        If there are no points, a single typical distance is returned.
        """
        config = self._config
        view = config.carried(guess.pose)
        points = visible_points(frames, view, config, config.range, border=BORDER)
        if len(points.gate):
            variance = guess.spread(normal_moves(points, config, guess.pose), points.gate)[:, 0, 0]
        else:
            variances = np.diag(guess.P)
            typical = variances[3:].mean() + variances[:3].mean() / TYPICAL**2
            variance = np.array([config.fx**2 * typical])
        return points, WITHIN * np.sqrt(variance) + STEADY

    def _seen(
        self,
        signal: np.ndarray,
        points: Points,
        reach: np.ndarray,
        guess: Guess,
        state: FilterState,
        rates: Vec3,
    ) -> FoundLines:
        """Return the steps and lines that a search for edges near points has found.

        Args:
            signal: weight of the gates' colour in each pixel  (height, width).
            points: points on expected edges.
            reach: distance within which each edge is searched for [px]  (n,) or (1,).
            guess: the pose that predicts the points.
            state: the filter's state, for its velocity.
            rates: body rates [rad/s].
        """
        velocity = np.array(state.nominal.velocity)
        late = self._late(points, guess.pose, velocity, rates)
        reach = np.broadcast_to(np.clip(reach, LEAST, LARGEST), len(points.gate))
        found = steps(signal, points.pixel + late, points.normal, reach)
        return FoundLines(found, *lines(points, found, len(self._frames.centre)))

    def _late(
        self,
        points: Points,
        pose: BodyPose,
        velocity: np.ndarray,
        rates: Vec3,
    ) -> np.ndarray:
        """Return the movement of each point until its row is exposed [px].  (n, 2)"""
        config = self._config
        if not config.readout or not len(points.pixel):
            return np.zeros((len(points.pixel), 2))
        half = 0.5 * config.readout
        moved = pose.corrected(half * np.array([*velocity, *rates]))
        pixel, _ = config.to_pixels(config.carried(moved).local(points.position))
        # per unit of (v / height - 1 / 2)
        flow = 2.0 * (pixel - points.pixel)
        share = points.pixel[:, 1] / config.height - 0.5
        # A point is seen at the row in which it lies at that row's time.
        share = share / np.maximum(1.0 - flow[:, 1] / config.height, 0.5)
        return flow * share[:, None]

    def _ends(self, frames: Frames, view: CameraPose) -> np.ndarray:
        """Return the signed distances of each edge's ends from its middle [px].  (G, EDGES, 2)

        Both are measured along the projected edge; edges that reach behind the camera have none.
        """
        local = view.local(frames.edges(view.eye).reshape(-1, 3))
        pixels, depth = self._config.to_pixels(local)
        pixels = pixels.reshape(-1, EDGES, 2, 2)
        length = np.linalg.norm(pixels[:, :, 1] - pixels[:, :, 0], axis=-1)
        ahead = (depth.reshape(-1, EDGES, 2) > NEAREST).all(axis=-1)
        half = np.where(ahead, 0.5 * length, np.nan)
        return np.stack([-half, half], axis=-1)

    def _in_view(self, frames: Frames, view: CameraPose) -> int:
        """Return the number of corners that are predicted to lie in the picture."""
        local = view.local(frames.corners.reshape(-1, 3))
        pixels, depth = self._config.to_pixels(local)
        inside = self._config.in_picture(pixels) & (depth > NEAREST)
        near = np.linalg.norm(local, axis=1) < self._config.range
        own = np.repeat(np.arange(len(frames.centre)), 4)
        points = frames.corners.reshape(-1, 3)
        return int((inside & near & ~frames.hide(points, own, view.eye)).sum())
