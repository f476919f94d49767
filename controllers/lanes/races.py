"""Generate the loops of races of several vehicles, which run after a step of the environments.

The environments' own loops (quadsim.controllers.lanes.environment) step each vehicle as if it were
alone. The loops here add the interactions between vehicles: collisions, ranks, and observations of
the opponents.

The loops run over lanes. Racer a of race r is lane r % LANES of block r // LANES * racers + a. The
vehicles of a race therefore share a lane of consecutive blocks (a group), and a loop over lanes
compares racer a with racer b in LANES races at once.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from quadsim.controllers.lanes.compiled import load_module
from quadsim.controllers.lanes.parts import Point, fill, header, read, store
from quadsim.controllers.lanes.text import Writer
from quadsim.controllers.lanes.trace import Graph, trace, trace_number
from quadsim.dynamics import System
from quadsim.dynamics.named_tuples import flat

MOST_RACERS = 8
NEVER = 1e9  # finishing step of a racer that has not finished


class Racing(NamedTuple):
    """The plain functions that a race adds to the environments of its vehicles."""

    # (start, end) -> least squared distance from the origin on the line between two Points [m^2]
    nearest: Callable[..., Any]
    # (x, away) -> record of the numbers observed of an opponent, its presence first
    opponent: Callable[..., Any]
    # NamedTuple: relative position and velocity of an opponent
    away: type
    # (collided, gained, p) -> number that is added to the reward
    reward: Callable[..., Any]
    # NamedTuple: the weights p of the reward
    weights: type


MEET = """
from quadsim.controllers.lanes.race_loops import ABSENT, apart, nearer_first, order

@inner
def least_apart(a_before, b_before, a_after, b_after, least):
    # the squared distance at which two vehicles pass each other in this step, in every lane
    for l in range(L):
        <nearest>

@kept
@njit(fastmath=FAST, error_model="numpy", nogil=True)
def meet(desk, first, last, episodes, outcome, field, rules):
    if desk:
        share(desk, last)
        return
    racers = rules.racers
    states = episodes.states
    steps = episodes.steps
    ended = outcome.ended
    crashed = outcome.crashed_now
    out = field.out
    <read_weights>
    flies = np.empty((<most>, L), np.int32)
    least = np.empty(L, F)
    place = np.empty((<most>, L), np.int32)
    hit = np.empty((<most>, L), F)
    paid = np.empty(L, F)
    for g in range(first, last):
        ours = g * racers
        finish = field.finish[ours : ours + racers]
        row = episodes.row[ours : ours + racers]
        way = episodes.way[ours : ours + racers]

        # who is in the air: not who was out before this step, or has finished in it
        for a in range(racers):
            b = ours + a
            for l in range(L):
                finishes = ended[b, l] & (not crashed[b, l])
                flies[a, l] = np.int32(0) if out[b, l] | finishes else np.int32(1)
                hit[a, l] = F(0)
                place[a, l] = np.int32(1)

        # who comes too near to whom
        for a in range(racers):
            for b in range(a + 1, racers):
                least_apart(field.before[ours + a], field.before[ours + b], states[ours + a],
                            states[ours + b], least)
                for l in range(L):
                    both = (flies[a, l] & flies[b, l]) > 0
                    touch = F(1) if both & (least[l] < rules.too_near) else F(0)
                    hit[a, l] = higher(hit[a, l], touch)
                    hit[b, l] = higher(hit[b, l], touch)

        # who of them is out, and who has finished
        for a in range(racers):
            b = ours + a
            for l in range(L):
                touched = hit[a, l] > F(0)
                # a racer that has hit a frame in this step has paid for a crash already
                hit[a, l] = F(0) if crashed[b, l] else hit[a, l]
                field.collided[b, l] = touched
                crashed[b, l] |= touched
                ended[b, l] |= touched
                outcome.cut[b, l] &= not touched
                episodes.over[b, l] |= touched
                if ended[b, l] & (not crashed[b, l]):
                    finish[a, l] = F(steps[b, l])

        # who is where, and what the places gained are worth
        for a in range(racers):
            for b in range(a + 1, racers):
                order(a, b, finish, row, way, place)
        for a in range(racers):
            b = ours + a
            for l in range(L):
                # before the first step there are no places
                gained = F(field.rank[b, l] - place[a, l]) if steps[b, l] > 1 else F(0)
                <pay>
            for l in range(L):
                field.rank[b, l] = place[a, l]
                outcome.reward_of[b, l] += F(0) if out[b, l] else paid[l]
"""

LOOK = """
from quadsim.controllers.lanes.normals import normal_rows

@inner
def observe(state, near, j, seen):
    # the numbers of the j-th nearest opponent, zeros where there is none
    for l in range(L):
        absent = near[0, l] >= ABSENT
        <observe>

@inner
def add_noise(seen, noise, lane, key, call):
    numbers = seen.shape[0]
    drawn_noise = np.empty((numbers, L), F)
    normal_rows(drawn_noise, noise, lane, <group>, key, call)
    for k in range(numbers):
        here = k // <size> * <size>
        for l in range(L):
            seen[k, l] += drawn_noise[k, l] * seen[here, l]

@kept
@njit(fastmath=FAST, error_model="numpy", nogil=True)
def look(desk, first, last, episodes, field, looks, chosen):
    if desk:
        share(desk, last)
        return
    racers = looks.racers
    noise = looks.noise
    opponents = racers - 1
    state = np.empty((<n_x>, L), F)
    near = np.empty((<most> - 1, 7, L), F)
    seen = np.empty(((<most> - 1) * <size>, L), F)
    swaps = np.empty(L, np.int32)
    for g in range(first, last):
        if chosen[g]:
            ours = g * racers
            for a in range(racers):
                mine = episodes.states[ours + a]
                for k in range(<n_x>):
                    for l in range(L):
                        state[k, l] = mine[k, l]
                for j in range(opponents):
                    b = ours + (j if j < a else j + 1)
                    apart(state, episodes.states[b], episodes.over[b], near[j])
                for end in range(opponents - 1, 0, -1):
                    for j in range(end):
                        nearer_first(near[j], near[j + 1], swaps)
                for j in range(opponents):
                    observe(state, near[j], j, seen)
                if noise[1] > F(0):
                    lane = (ours + a) * L
                    add_noise(seen[: opponents * <size>], noise, lane, looks.key, looks.call)

                # a racer that was out before sees nothing
                to = field.others[ours + a]
                gone = field.out[ours + a]
                for k in range(opponents * <size>):
                    for l in range(L):
                        to[k, l] = F(0) if gone[l] else seen[k, l]
                own = episodes.obs[ours + a]
                for k in range(own.shape[0]):
                    for l in range(L):
                        own[k, l] = F(0) if gone[l] else own[k, l]
"""


@cache
def _load(source: str) -> ModuleType:
    """Return the module with a source text, compiled at its first use."""
    digest = hashlib.sha256(source.encode()).hexdigest()[:16]
    return load_module(f"races_{digest}", source)


def races_module(system: System, racing: Racing, observed: int) -> ModuleType:
    """Return the compiled loops `meet` and `look`.

    They are loaded from the disk's cache if they were built before.

    Args:
        system: the model of a vehicle.
        racing: the functions of a race.
        observed: size of the observation of a single vehicle.
    """
    return _load(races_source(system, racing, observed))


def races_source(system: System, racing: Racing, observed: int) -> str:
    """Return the text of the module with the loops `meet` and `look`.

    Raises:
        TraceError: one of the functions uses an operation that cannot be compiled.
    """
    nearest = _nearest(racing)
    pay, read_weights = _pay(racing)
    seen = _seen(system, racing)
    sizes = {"n_x": len(system.states), "most": MOST_RACERS, "size": seen.size}
    # the noise of the vehicle's own numbers uses the groups of four before these
    group = -(-observed // 4)
    texts = (
        header(np.float32),
        fill(MEET, **sizes, nearest=nearest, pay=pay, read_weights=read_weights),
        fill(LOOK, **sizes, observe=seen.text, group=group),
    )
    return "\n".join(texts)


def _nearest(racing: Racing) -> str:
    """Return the lines for the least distance between two vehicles that fly straight in a step."""
    graph = Graph()
    a_before = graph.record(Point, "a_from", "a_before[{k}, l]")
    b_before = graph.record(Point, "b_from", "b_before[{k}, l]")
    a_after = graph.record(Point, "a_to", "a_after[{k}, l]")
    b_after = graph.record(Point, "b_to", "b_after[{k}, l]")
    start = Point(*(b - a for a, b in zip(a_before, b_before, strict=True)))
    end = Point(*(b - a for a, b in zip(a_after, b_after, strict=True)))
    found = trace_number(racing.nearest, start, end)
    writer = Writer(MEET)
    return "\n".join((writer.lines([found]), f"least[l] = {writer(found)}"))


def _pay(racing: Racing) -> tuple[str, str]:
    """Return the lines for the additional reward of a race, and the lines that read its weights."""
    graph = Graph()
    touched = graph.input("has_touched", "hit[a, l]")
    gained = graph.variable("gained")
    weights = graph.record(racing.weights, "weight")
    found = trace_number(racing.reward, touched, gained, weights)
    writer = Writer(MEET)
    lines = "\n".join((writer.lines([found]), f"paid[l] = {writer(found)}"))
    return lines, read(racing.weights, "weight", "rules.p_reward[{k}]", writer)


class _Seen(NamedTuple):
    """The observation of an opponent."""

    text: str  # the lines that compute and store it
    size: int  # number of observed numbers


def _seen(system: System, racing: Racing) -> _Seen:
    """Return the lines for the observation of the j-th nearest opponent."""
    graph = Graph()
    x = graph.record(system.state, "x", "state[{k}, l]")
    away = graph.record(racing.away, "away", "near[1 + {k}, l]")
    absent = graph.variable("absent")
    seen = [
        graph.apply("where", absent, 0.0, number)
        for number in flat(trace(racing.opponent, x, away))
    ]
    writer = Writer(LOOK)
    lines = writer.lines(seen)
    stores = store(tuple(seen), f"seen[j * {len(seen)} + {{k}}, l]", writer)
    return _Seen(text="\n".join((lines, stores)), size=len(seen))
