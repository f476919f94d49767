"""Generate the loops that step many learning environments.

One step is the model, the gate tests, the observation, the reward and, at the end of an episode, a
restart. The inlined functions are the same as in a rollout, and like a rollout the loops run over
lanes: environment i is lane i % LANES of block i // LANES. All environments of a block share a
course.

The text consists of the templates RESTART, PARTS and ADVANCE, in which the traced lines replace the
places `<name>` (see `parts.fill`). The core of `advance` then reads

    for l in range(L):
        # the action within -1..1, as a command
        action_thrust = lower(higher(action[3, l], F(-1)), F(1))
        u_thrust = low_thrust + (F(1.0) + action_thrust) * half_thrust
        # quadrotor: step
        ...
        after[0, l] = px
        clipped[3, l] = action_thrust

Rare events, a passed gate or the end of an episode, set a flag, and a separate loop handles them.
An episode starts from a row of `starts`: the state, the number of its target row, the
parameters of the system, the last action. The choice of the row depends only on the seed, the
environment and the number of the episode, and not on threads.

LLVM vectorises a lane loop only if it can prove that written and read arrays do not overlap. So the
lane loops write to arrays made in the same function, with a layout that the compiler knows, and
`move` copies rows from and to the arguments. These arrays are reused for many blocks, because
allocating them takes longer than a step.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from quadsim.controllers.costs import Cost, StepFunction
from quadsim.controllers.lanes.compiled import load_module
from quadsim.controllers.lanes.parts import fill, header, line_test, next_targets, read, store
from quadsim.controllers.lanes.planner_loops import trace_model
from quadsim.controllers.lanes.text import Writer
from quadsim.controllers.lanes.trace import Graph, Symbol, Value, trace, trace_number
from quadsim.dynamics import System
from quadsim.dynamics.named_tuples import flat, flat_names

# The step in which an ended episode restarts
SAME_STEP = 0
NEXT_STEP = 1
DISABLED = 2
# The vehicle of an ended episode stays at its place until `begin` starts the next episode
WAIT = 3

SLACK = 1e-3  # reduction of a vehicle's distance to the obstacles, for rounding [m]


class Learning(NamedTuple):
    """The plain functions that an environment adds to a model and its cost."""

    # (x, gates, last action) -> record of the observed numbers
    observation: Callable[..., Any]
    # NamedTuple: the next gates, from the row of the course
    gates: type
    # (progress, clearance, crashed, reached, action, last action, p) -> number
    reward: Callable[..., Any]
    # NamedTuple: the weights p of the reward
    weights: type
    # Terms of the cost: the remaining way, and the shortfall of the margin
    progress: StepFunction
    clearance: StepFunction


RESTART = """
from quadsim.controllers.lanes.episode_loops import add_noise, drawn, hold, judge, move

@inner
def restart(l, b, environment, episodes, beginnings):
    # a lane of block b begins its next episode
    c = beginnings.course[b]
    state = episodes.states[b]
    target = episodes.rows[b]
    model = episodes.models[b]
    last = episodes.actions_before[b]
    obs = episodes.obs[b]
    starts = beginnings.starts[c]
    start = starts[drawn(beginnings.seed, environment, episodes.episode[b, l], starts.shape[0])]
    for k in range(<n_x>):
        state[k, l] = start[k]
    row = np.int32(start[<n_x>])
    for k in range(<n_p>):
        model[k, l] = start[<n_x> + 1 + k]
    for k in range(<n_u>):
        last[k, l] = start[<n_x> + 1 + <n_p> + k]
    for k in range(<n_row>):
        target[k, l] = beginnings.targets[c, row, k]
    episodes.row[b, l] = row
    episodes.room[b, l] = F(0)
    episodes.steps[b, l] = 0
    episodes.passes[b, l] = 0
    episodes.episode[b, l] += 1
    <observe>

@kept
@njit(fastmath=FAST, error_model="numpy", nogil=True)
def begin(desk, first, last, episodes, beginnings, chosen, racers):
    if desk:
        share(desk, last)
        return
    # `racers` blocks in a row hold the vehicles of the same races: one draw starts all of a race
    for b in range(first, last):
        for l in range(L):
            if chosen[b, l]:
                restart(l, b, b // racers * L + l, episodes, beginnings)
                episodes.over[b, l] = False
"""

PARTS = """
@inner
def meet_obstacles(state, after, moved, room, crashed, obstacles):
    # room: no box around an obstacle is nearer [m]. A vehicle is tested again after it has flown
    # this far.
    near = np.int32(0)
    for l in range(L):
        room[l] -= moved[l]
        near |= np.int32(1) if room[l] < F(0) else np.int32(0)
    if near == 0:
        return
    for l in range(L):
        if room[l] < F(0):
            reach = moved[l] + F(<slack>)
            least = F(1e12)
            for o in range(obstacles.shape[0]):
                <read_obstacle>
                x = higher(obstacle_x_low - after[0, l], after[0, l] - obstacle_x_high)
                y = higher(obstacle_y_low - after[1, l], after[1, l] - obstacle_y_high)
                z = higher(obstacle_z_low - after[2, l], after[2, l] - obstacle_z_high)
                x = higher(x, F(0))
                y = higher(y, F(0))
                z = higher(z, F(0))
                apart = x * x + y * y + z * z
                least = lower(least, apart)
                if apart <= reach * reach:
                    <lines>
                    if <touches>:
                        crashed[l] = F(1)
            room[l] = math.sqrt(least) - F(<slack>)

@inner
def next_targets(target, row, passes, reached, targets, last_row):
    <next_targets>
"""

ADVANCE = """
@kept
@njit(fastmath=FAST, error_model="numpy", nogil=True)
def advance(desk, first, last, episodes, beginnings, step, outcome):
    if desk:
        share(desk, last)
        return
    dt = step.dt
    mode = step.mode
    <read_command>
    <read_reward>
    # arrays that are read: state, action, target row, the vehicle's parameters, last action,
    # next gates
    state = np.empty((<n_x>, L), F)
    action = np.empty((<n_u>, L), F)
    target = np.empty((<n_target>, L), F)
    model = np.empty((<n_p>, L), F)
    before = np.empty((<n_u>, L), F)
    gates = np.empty((<n_gates>, L), F)
    # arrays that are written: next state, clipped action, observation
    after = np.empty((<n_x>, L), F)
    clipped = np.empty((<n_u>, L), F)
    seen = np.empty((<n_obs>, L), F)
    way_now = np.empty(L, F)
    way_before = np.empty(L, F)
    clearance = np.empty(L, F)
    crashed = np.empty(L, F)
    moved = np.empty(L, F)
    paid = np.empty(L, F)
    reached = np.empty(L, np.int32)
    for b in range(first, last):
        c = beginnings.course[b]
        last_row = step.last_row[c]
        row = episodes.row[b]
        steps = episodes.steps[b]
        over = episodes.over[b]
        way = episodes.way[b]
        obs = episodes.obs[b]
        ended = outcome.ended[b]
        cut = outcome.cut[b]
        passed = outcome.passed[b]
        crashed_now = outcome.crashed_now[b]

        # one step of the model, with the terms of the reward
        move(episodes.states[b], state)
        move(step.actions[b], action)
        move(episodes.rows[b][:<n_target>], target)
        move(episodes.models[b], model)
        <read_cost>
        for l in range(L):
            <step>
            dx = after[0, l] - state[0, l]
            dy = after[1, l] - state[1, l]
            dz = after[2, l] - state[2, l]
            moved[l] = math.sqrt(dx * dx + dy * dy + dz * dz)
        if mode == <WAIT>:
            hold(over, state, after, moved, way, way_now, crashed, reached)
        for l in range(L):
            way_before[l] = way[l] if steps[l] > 0 else way_now[l]
        meet_obstacles(episodes.states[b], after, moved, episodes.room[b], crashed,
                       step.obstacles[c, : step.n_obstacles[c]])

        # reward and observation, with the next gates
        next_targets(episodes.rows[b], row, episodes.passes[b], reached, beginnings.targets[c],
                     last_row)
        move(episodes.actions_before[b], before)
        move(episodes.rows[b][<n_target>:], gates)
        for l in range(L):
            <pay>
        move(after, episodes.states[b])
        move(clipped, episodes.actions_before[b])
        move(seen, obs)
        for l in range(L):
            way[l] = way_now[l]
            outcome.reward_of[b, l] = paid[l]

        # episodes that have ended
        if judge(b, crashed, reached, episodes, outcome, last_row, step.limit):
            for l in range(L):
                waited = over[l] and mode == <WAIT>
                if waited:
                    steps[l] -= np.int32(1)
                if waited or (over[l] and mode == <NEXT_STEP>):
                    ended[l] = False
                    cut[l] = False
                    passed[l] = False
                    crashed_now[l] = False
                    outcome.reward_of[b, l] = F(0)
                done = ended[l] or cut[l]
                again = done if mode == <SAME_STEP> else over[l] and mode == <NEXT_STEP>
                over[l] = waited or (done and mode != <SAME_STEP>)
                if done and mode == <SAME_STEP>:
                    for k in range(<n_obs>):
                        outcome.final[b, k, l] = obs[k, l]
                if again:
                    restart(l, b, b * L + l, episodes, beginnings)
        if step.noise[0] >= F(0):
            add_noise(obs, step.noise, b * L, step.key, step.call)
"""


@cache
def _load(source: str) -> ModuleType:
    """Return the module with a source text, compiled at its first use."""
    digest = hashlib.sha256(source.encode()).hexdigest()[:16]
    return load_module(f"environment_{digest}", source)


def environment_module(system: System, cost: Cost, learning: Learning) -> ModuleType:
    """Return the compiled loops `begin` and `advance`.

    They are loaded from the disk's cache if they were built before.
    """
    return _load(environment_source(system, cost, learning))


def environment_source(system: System, cost: Cost, learning: Learning) -> str:
    """Return the text of the module with the loops `begin` and `advance`.

    The text depends on the names and functions of model and cost, not on their numbers.

    Raises:
        TraceError: one of the functions uses an operation that cannot be compiled.
    """
    assert cost.obstacles
    sizes = {
        "n_x": len(system.states),
        "n_u": len(system.controls),
        "n_p": len(system.params),
        "n_target": len(cost.row._fields),
        "n_gates": len(tuple(flat_names(learning.gates))),
    }
    sizes["n_row"] = sizes["n_target"] + sizes["n_gates"]
    observed = _observe(system, learning, first_gate=sizes["n_target"])
    sizes["n_obs"] = observed.size
    test = line_test(
        cost.obstacles.touches,
        cost.obstacles.row,
        p0="state[{k}, l]",
        p1="after[{k}, l]",
        around=PARTS,
    )
    next_rows = next_targets("target.shape[0]", count="passes[l] += 1")
    step = _step(system, cost, learning)
    pay = _pay(system, learning)
    modes = {"SAME_STEP": SAME_STEP, "NEXT_STEP": NEXT_STEP, "WAIT": WAIT}
    texts = (
        header(np.float32),
        fill(RESTART, **sizes, observe=observed.text),
        fill(PARTS, **sizes, **test._asdict(), slack=repr(SLACK), next_targets=next_rows),
        fill(ADVANCE, **sizes, **modes, **step, **pay),
    )
    return "\n".join(texts)


def _step(system: System, cost: Cost, learning: Learning) -> dict[str, str]:
    """Return the text of the lane loop of one step, and of the lines that read its numbers.

    The loop converts the action to a command, steps the model and computes the terms of the reward.

    Returns:
        Parts of ADVANCE, by the name of their place.
    """
    # Trace
    graph = Graph()
    x = graph.record(system.state, "x", "state[{k}, l]")
    target = graph.record(cost.row, "target", "target[{k}, l]")
    model = graph.record(type(system.params), "model", "model[{k}, l]")
    shared = graph.record(type(cost.params), "p")
    graph.section = "the action within -1..1, as a command"
    action = system.control(*(_action(graph, name, k) for k, name in enumerate(system.controls)))
    u = system.control(*map(_command, system.controls, action))
    x_next = trace_model(graph, system, x, u, model)
    graph.section = "whether the vehicle crashes"
    crashes = _condition(cost.crash, x, x_next, u, target, shared)
    crashed = graph.apply("where", crashes, 1.0, 0.0)
    graph.section = "whether it reaches its target"
    reached = _condition(cost.reached, x, x_next, u, target, shared)
    graph.section = "what the reward is made of"
    way = trace_number(learning.progress, x, x_next, u, target, shared)
    clearance = trace_number(learning.clearance, x, x_next, u, target, shared)

    # Write
    writer = Writer(ADVANCE)
    lines = writer.lines([*flat(x_next), *action, crashed, reached, way, clearance])
    stores = (
        store(x_next, "after[{k}, l]", writer),
        store(action, "clipped[{k}, l]", writer),
        f"way_now[l] = {writer(way)}",
        f"clearance[l] = {writer(clearance)}",
        f"crashed[l] = {writer(crashed)}",
        f"reached[l] = np.int32(1) if {writer(reached)} else np.int32(0)",
    )
    read_command = [
        f"{side}_{name} = step.{side}[{k}]"
        for side in ("low", "half")
        for k, name in enumerate(system.controls)
    ]
    return {
        "step": "\n".join((lines, *stores)),
        "read_cost": read(type(cost.params), "p", "step.p_cost[c, {k}]", writer),
        "read_command": "\n".join(read_command),
    }


def _action(graph: Graph, name: str, k: int) -> Symbol:
    """Return number k of the action, clipped to -1..1, as an input of the graph."""
    return graph.input(f"action_{name}", f"lower(higher(action[{k}, l], F(-1)), F(1))")


def _command(name: str, action: Symbol) -> Symbol:
    """Return the control with this name for an action in -1..1."""
    low = action.graph.variable(f"low_{name}")
    command = low + (1.0 + action) * action.graph.variable(f"half_{name}")
    command.name = f"u_{name}"
    return command


def _condition(function: StepFunction | None, *args: Any) -> Value:
    """Return the traced result of a cost's function that is optional, but needed for learning."""
    assert function
    return trace_number(function, *args)


def _pay(system: System, learning: Learning) -> dict[str, str]:
    """Return the text of the lane loop of reward and observation, which runs after a step.

    Returns:
        Parts of ADVANCE, by the name of their place.
    """
    # Trace
    graph = Graph()
    x = graph.record(system.state, "x", "after[{k}, l]")
    action = graph.record(system.control, "action", "clipped[{k}, l]")
    last = graph.record(system.control, "last", "before[{k}, l]")
    gates = graph.record(learning.gates, "gates", "gates[{k}, l]")
    progress = graph.input("progress", "way_before[l] - way_now[l]")
    clearance = graph.input("short_of_margin", "clearance[l]")
    crashed = graph.input("has_crashed", "crashed[l]")
    reached = graph.input("has_passed", "F(reached[l])")
    graph.section = "the reward"
    weights = graph.record(learning.weights, "weight")
    paid = trace_number(
        learning.reward, progress, clearance, crashed, reached, action, last, weights
    )
    graph.section = "the observation"
    seen = trace(learning.observation, x, gates, action)

    # Write
    writer = Writer(ADVANCE)
    lines = writer.lines([paid, *flat(seen)])
    pay = (lines, f"paid[l] = {writer(paid)}", store(seen, "seen[{k}, l]", writer))
    return {
        "pay": "\n".join(pay),
        "read_reward": read(learning.weights, "weight", "step.p_reward[{k}]", writer),
    }


class _Observed(NamedTuple):
    """The observation at the start of an episode."""

    text: str  # the lines that compute and store it
    size: int  # number of observed numbers


def _observe(system: System, learning: Learning, first_gate: int) -> _Observed:
    """Return the text of the observation at the start of an episode.

    Args:
        system: the model.
        learning: the functions of the environment.
        first_gate: index of the first number of the next gates in a course's row.
    """
    graph = Graph()
    x = graph.record(system.state, "x", "state[{k}, l]")
    gates = graph.record(learning.gates, "gates", f"target[{first_gate} + {{k}}, l]")
    last = graph.record(system.control, "last", "last[{k}, l]")
    seen = tuple(flat(trace(learning.observation, x, gates, last)))
    writer = Writer(RESTART)
    lines = writer.lines(seen)
    return _Observed(text="\n".join((lines, store(seen, "obs[{k}, l]", writer))), size=len(seen))
