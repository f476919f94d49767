"""Find contacts with frames and crossings of gates' planes within one physics step.

The referee decides what a contact or a crossing means.

In the gate frame (x along the legal passage) the vehicle is a sphere of radius r whose centre moves
on a segment. The four bars, as boxes grown by r, are a slab around a free shaft: the sphere touches
a bar if its centre is in the slab and not in the shaft. quadsim.course.opening defines both.
The edges of a grown box are not rounded, so contact is found up to .42 r early at the bars' edges
and .73 r at their corners. It is exact on their faces and straight through the opening.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, hypot, inf, sqrt
from typing import NamedTuple

import numpy as np

from quadsim.course.frames import frame_numbers
from quadsim.course.gate import Gate
from quadsim.course.opening import (
    HalfSizes,
    InGate,
    Offset,
    between,
    beyond,
    crossing,
    free_half_sizes,
    half_depth,
    half_sizes,
    on_passage,
    outer_half_sizes,
)
from quadsim.rotation import Vec3


class Incident(NamedTuple):
    """A contact or a crossing within one step, to which the rules are still to be applied."""

    # fraction of the step
    s: float
    # touch, forward, backward; of the referee: ground, bounds, stuck, timeout, contact
    kind: str
    # index; -1: no gate
    gate: int = -1
    # from the centre of the opening [m]
    offset: Offset = Offset(0.0, 0.0)
    # index; -1: no obstacle
    obstacle: int = -1
    # index of the first gate of the same physical frame; -1: no gate
    frame: int = -1

    @property
    def touched(self) -> str:
        """The name of the touched object, such as "gate 3" or "obstacle 2"."""
        return f"obstacle {self.obstacle + 1}" if self.obstacle >= 0 else f"gate {self.frame + 1}"


def clip(
    a: Sequence[float], b: Sequence[float], low: Vec3, high: Vec3
) -> tuple[float, float] | None:
    """Return the part of the segment a -> b inside a box (Liang and Barsky 1984).

    Args:
        a, b: ends of the segment [m].
        low, high: corners of the box [m].

    Returns:
        The fractions (s_in, s_out) of the segment, None if it stays outside.
    """
    s_in = 0.0
    s_out = 1.0
    for p, q, lo, hi in zip(a, b, low, high, strict=True):
        if p == q:
            if not lo <= p <= hi:
                return None
        else:
            first, last = sorted(((lo - p) / (q - p), (hi - p) / (q - p)))
            s_in = max(s_in, first)
            s_out = min(s_out, last)
    return (s_in, s_out) if s_in <= s_out else None


def _clip_centred(a: Vec3, b: Vec3, half: Vec3) -> tuple[float, float] | None:
    """Return the part of the segment a -> b inside a box about the origin, as `clip` does."""
    return clip(a, b, (-half[0], -half[1], -half[2]), half)


def lerp(a: Vec3, b: Vec3, s: float) -> Vec3:
    """Return the point at the fraction s of the segment a -> b."""
    return (a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2]))


def first_within(a0: Vec3, a1: Vec3, b0: Vec3, b1: Vec3, reach: float) -> float | None:
    """Return the fraction of a step at which two points come within reach of each other.

    Both move on straight lines, so the vector between them does, too.

    Args:
        a0, a1: the first point before and after the step [m].
        b0, b1: the second point before and after the step [m].
        reach: distance [m].

    Returns:
        0 if they are within reach from the beginning; None if they never are.
    """
    way = (b0[0] - a0[0], b0[1] - a0[1], b0[2] - a0[2])
    change = (b1[0] - a1[0] - way[0], b1[1] - a1[1] - way[1], b1[2] - a1[2] - way[2])

    # |way + s change|^2 = reach^2 is a quadratic equation in s: a s^2 + 2 b s + c = 0.
    a = sum(d * d for d in change)
    b = sum(w * d for w, d in zip(way, change, strict=True))
    c = sum(w * w for w in way) - reach * reach
    if c <= 0.0:
        return 0.0
    discriminant = b * b - a * c
    if b >= 0.0 or discriminant < 0.0:
        return None
    s = (-b - sqrt(discriminant)) / a
    return s if s <= 1.0 else None


class SweptGate:
    """One gate, and the radius [m] of the sphere that flies through it."""

    def __init__(self, gate: Gate, index: int, radius: float, frame: int | None = None):
        """Prepare the tests of one gate.

        Args:
            gate: gate of the course.
            index: index of the gate, which its incidents carry.
            radius: radius of the sphere [m].
            frame: index of the first gate of its physical frame; None: the same as `index`.
        """
        self.gate = gate
        self.index = index
        self.frame = index if frame is None else frame
        # half sizes within which the sphere's centre is free, and outside which it is free [m]
        self.free = free_half_sizes(gate.opening, radius)
        self.outer = outer_half_sizes(gate.opening, gate.frame_width, radius)
        self.half_depth = half_depth(radius, depth=gate.frame_depth)
        # half extents of the shaft through the opening, without ends, and of the slab that the
        # grown bars fill [m]
        self._shaft: Vec3 = (inf, self.free.left, self.free.up)
        self._slab: Vec3 = (self.half_depth, self.outer.left, self.outer.up)
        # half sizes within which a crossing of the plane is about this gate: three of the
        # opening's, and 2 m
        half = half_sizes(gate.opening)
        self.near = HalfSizes(3.0 * half.left + 2.0, 3.0 * half.up + 2.0)
        # radius about the centre outside which nothing concerns this gate [m]
        aside = max(self.near.left, self.outer.left)
        above = max(self.near.up, self.outer.up)
        self.reach = hypot(self.half_depth, aside, above)

    def on_passage(self, offset: Offset) -> bool:
        """Return whether a point of the gate's plane lies in the opening or on the frame."""
        return on_passage(offset, self.gate.opening, self.gate.frame_width)

    def is_near(self, offset: Offset) -> bool:
        """Return whether a crossing of the plane at this point concerns this gate."""
        return beyond(offset, self.near) <= 0.0

    def touch(self, a: InGate, b: InGate) -> float | None:
        """Return the fraction of a segment at which it first enters a grown bar.

        Args:
            a, b: ends of the segment in the gate frame [m].

        Returns:
            The fraction, from 0 to 1; None if the segment enters no bar.
        """
        slab = _clip_centred(a, b, self._slab)
        if slab is None:
            return None
        shaft = _clip_centred(a, b, self._shaft)
        if shaft is None or not shaft[0] <= slab[0] <= shaft[1]:
            return slab[0]
        return shaft[1] if shaft[1] < slab[1] else None

    def incidents(self, p0: Vec3, p1: Vec3) -> list[Incident]:
        """Return the contact and the crossing of a segment, contact first at the same instant.

        Args:
            p0, p1: ends of the segment in the world [m].
        """
        a = self.gate.to_local(p0)
        b = self.gate.to_local(p1)
        found = []
        touched = self.touch(a, b)
        if touched is not None:
            at = between(a, b, touched).offset
            found.append(Incident(touched, "touch", self.index, at, frame=self.frame))
        crossed = crossing(a, b)
        if crossed is not None:
            kind = "forward" if crossed.forward else "backward"
            at = crossed.offset
            found.append(Incident(crossed.fraction, kind, self.index, at, frame=self.frame))
        return found

    def in_own_axes(self, incident: Incident, of: SweptGate, p0: Vec3, p1: Vec3) -> Incident:
        """Return an incident of the same frame in this gate's direction and axes.

        Args:
            incident: found by another gate of the frame.
            of: the gate that found it.
            p0, p1: ends of the segment in the world [m].
        """
        at = self.gate.to_local(lerp(p0, p1, incident.s))
        along = sum(a * b for a, b in zip(self.gate.axes[0], of.gate.axes[0], strict=True))
        kind = incident.kind
        if along < 0.0 and kind != "touch":
            kind = "backward" if kind == "forward" else "forward"
        return incident._replace(kind=kind, gate=self.index, offset=at.offset)


class SweptGates:
    """All gates of a course, for a vehicle of one radius.

    A gate that is flown through several times a lap has a single SweptGate. A frame that is flown
    from both sides has two, one for each side.

    Attributes:
        of: the SweptGate of each gate of the course.
        all: the first SweptGate of each physical frame.
    """

    def __init__(self, gates: Sequence[Gate], radius: float):
        """Prepare the tests of all gates.

        Args:
            gates: gates of the course, in order.
            radius: radius of the vehicle [m].
        """
        numbers = frame_numbers(gates)
        first: dict[Gate, SweptGate] = {}
        for index, gate in enumerate(gates):
            if gate not in first:
                first[gate] = SweptGate(gate, index, radius, numbers.index(numbers[index]))
        self.of = tuple(first[gate] for gate in gates)
        self.all = tuple(swept for swept in first.values() if swept.frame == swept.index)
        self._centres = np.array([g.gate.position for g in self.all])  # (gates, 3)
        self._reach = np.array([g.reach for g in self.all])  # (gates,)

    def near(self, p0: Vec3, p1: Vec3) -> list[SweptGate]:
        """Return the gates within reach of the ball around a segment."""
        square = ((self._centres - lerp(p0, p1, 0.5)) ** 2).sum(axis=1)  # (gates,)
        within = square <= (self._reach + dist(p0, p1) / 2) ** 2
        return [self.all[k] for k in np.flatnonzero(within)]
