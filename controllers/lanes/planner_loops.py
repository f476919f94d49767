"""Generate the planner's loops, which inline a model's step and a cost's terms.

`rollout` computes the costs of blocks of samples and, for display, the trajectories of one block.
`module_source` returns the text that is compiled; `race bench --show-code` prints it. For a point
mass on a line with a cost of one term its core reads

    for t in range(T):
        plan_ax = U[t, 0]
        ...
        weight_distance = cost_numbers[k_t, 0]
        for l in range(L):
            x_px = state[0, l]
            x_vx = state[1, l]
            # the control, within its limits
            u_ax = lower(higher(plan_ax + n_t * block[0, t0 + t, l], low_ax), high_ax)
            # point: step
            px = x_px + x_vx * dt
            vx = x_vx + u_ax * dt
            # term: distance
            cost_of_distance = weight_distance * px * px
            state[0, l] = px
            state[1, l] = vx
            cost[l] += s_t * (cost_of_distance)

The upper-case constants of this file are templates with places `<name>` for the lines that are
traced from the model and the cost, see `parts.fill`.

The lane loop has no gather and no data-dependent branch: if a sample reaches its target, a flag is
set, and a rarely executed second loop moves those lanes to their next target row. All numbers in
the lane loop are as wide as a float, because one 64-bit integer would halve the number of lanes of
all vectors.

Obstacles are tested by straight lines between positions `stride` steps apart (marks). After every
MARKS marks, bounding boxes around the marks of some lanes of the block select the obstacles,
because most blocks are near no obstacle. A sample that has touched an obstacle has crashed from the
end of that line on.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from quadsim.controllers.costs import Cost, StateTerm, Term, crash
from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.parts import (
    NEXT_TARGETS,
    fill,
    header,
    line_test,
    next_targets,
    read,
    store,
)
from quadsim.controllers.lanes.text import Writer
from quadsim.controllers.lanes.trace import (
    Graph,
    Symbol,
    TraceError,
    Value,
    check_number,
    label,
    trace,
    trace_number,
    wrong_result,
)
from quadsim.dynamics import System
from quadsim.dynamics.named_tuples import flat
from quadsim.files.yaml_errors import did_you_mean

MARKS = 4  # number of positions (marks) that are tested at once
STRIDE = 0.04  # time between two marks [s]
TERM_STRIDE = 0.1  # time between two marks of terms of the state [s]
# Bounding boxes of a block's positions, each of every sixteenth lane: as many as a vector has
# numbers
BOXES = min(LANES, 16)

BEGIN = """
# the state and the target row of each sample
state = np.empty((<states>, L), F)
target = np.empty((<target_numbers>, L), F)
cost = np.empty(L, F)
crashed = np.empty(L, F)
reached = np.empty(L, np.int32)
row = np.empty(L, np.int32)
for l in range(L):
    for k in range(<states>):
        state[k, l] = x0[k]
    for k in range(<target_numbers>):
        target[k, l] = targets[0, k]
    cost[l] = F(0)
    crashed[l] = F(0)
    row[l] = np.int32(0)
<begin_marks>
"""

# One step of one sample: u = clip(U + n z), the model, the terms at the next state.
STEP = """
<lines>
<store_state>
crashed[l] = <crashed>
reached[l] = np.int32(1) if <is_reached> else np.int32(0)
"""

ROLLOUT = """
@kept
@njit(fastmath=FAST, error_model="numpy", nogil=True)
def rollout(desk, first, last, x0, U, z, J, trajectory, numbers):
    if desk:
        share(desk, last)
        return
    low = numbers.low
    high = numbers.high
    targets = numbers.targets
    system_numbers = numbers.system
    cost_numbers = numbers.cost
    noise_factor = numbers.noise_factor
    cost_factor = numbers.cost_factor
    <read_obstacles>
    T = U.shape[0]
    halves = z.shape[2] // T
    last_row = np.int32(targets.shape[0] - 1)
    varies = cost_numbers.shape[0] > 1  # whether the parameters of the cost depend on the step
    lasts = numbers.dt.shape[0] > 1  # whether the steps differ in length
    <read_limits>
    for b in range(first, last):
        <begin>
        block = z[b // halves]
        t0 = (b % halves) * T
        for t in range(T):
            <read_plan>
            n_t = noise_factor[b % 2, t]
            s_t = cost_factor[t]
            k_t = t if varies else 0
            l_t = t if lasts else 0
            dt = numbers.dt[l_t]
            <read_model>
            <read_cost>
            for l in range(L):
                <step>
                cost[l] += s_t * (<sum>)
            <keep>
            <next_targets>
            <state_terms>
            <keep_marks>
        for l in range(L):
            J[b, l] = cost[l] / F(T)
"""

# Terms of the state alone, at marks: the targets are those after the step.
STATE_TERMS = """
m_t = numbers.mark_factor[t]
if m_t > F(0):
    for l in range(L):
        <lines>
        cost[l] += m_t * (<sum>)
"""

READ_OBSTACLES = """
obstacles = numbers.obstacles
stride = numbers.stride
line_marks = numbers.line_marks
crash_weight = numbers.crash_weight
"""

# For display: the state, whether the sample has crashed, and its target row in this step. The array
# is empty if nothing is displayed.
KEEP = """
if t < trajectory.shape[0]:
    for l in range(trajectory.shape[2]):
        for k in range(<states>):
            trajectory[t, k, l] = state[k, l]
        trajectory[t, <states>, l] = crashed[l]
        trajectory[t, <states> + 1, l] = F(row[l])
"""

BEGIN_MARKS = """
# positions between which lines are tested, the first one at the start
marked = np.empty((<marks>, 3, L), F)
lowest = np.empty((3, <boxes>), F)
highest = np.empty((3, <boxes>), F)
before_finish = np.empty(L, F)
marks = 1
for l in range(L):
    for k in range(3):
        marked[0, k, l] = x0[k]
    before_finish[l] = F(1) if last_row > 0 else F(0)
"""

KEEP_MARKS = """
if line_marks[t]:
    filled = <marks> if t == T - 1 else marks + 1  # at the end the last position fills what is left
    for m in range(marks, filled):
        for k in range(3):
            for l in range(L):
                marked[m, k, l] = state[k, l]
    marks = filled
    if marks == <marks>:
        meet_obstacles(marked, lowest, highest, obstacles, stride, crash_weight, before_finish,
                       crashed, cost)
        marks = 1
        for l in range(L):
            before_finish[l] = F(1) if row[l] < last_row else F(0)
"""

MEET_OBSTACLES = """
@inner
def meet_obstacles(marked, lowest, highest, obstacles, stride, crash_weight, before_finish, crashed,
                   cost):
    # boxes around the marked positions of some lanes each
    for k in range(3):
        for l in range(<boxes>):
            low = marked[0, k, l]
            high = marked[0, k, l]
            for m in range(<marks>):
                for first in range(0, L, <boxes>):
                    low = lower(low, marked[m, k, first + l])
                    high = higher(high, marked[m, k, first + l])
            lowest[k, l] = low
            highest[k, l] = high
    for o in range(obstacles.shape[0]):
        <read_obstacle>
        near = np.int32(0)
        for l in range(<boxes>):
            near_x = (lowest[0, l] <= obstacle_x_high) & (highest[0, l] >= obstacle_x_low)
            near_y = (lowest[1, l] <= obstacle_y_high) & (highest[1, l] >= obstacle_y_low)
            near_z = (lowest[2, l] <= obstacle_z_high) & (highest[2, l] >= obstacle_z_low)
            near |= np.int32(1) if near_x & near_y & near_z else np.int32(0)
        if near == 0:
            continue
        for m in range(1, <marks>):
            # a crash is paid for the steps from the end of this line to the last mark
            due = crash_weight * F((<marks> - 1 - m) * stride + 1)
            for l in range(L):
                <lines>
                new = select(<touches>, higher(F(1) - crashed[l], F(0)), F(0)) * before_finish[l]
                crashed[l] += new
                cost[l] += due * new
    # the last position is the first of the next lines
    for k in range(3):
        for l in range(L):
            marked[0, k, l] = marked[<marks> - 1, k, l]
"""


def steps_between(dt: float) -> int:
    """Return the number of steps from one mark to the next, for a control period dt [s]."""
    return max(round(STRIDE / dt), 1)


def term_steps(dt: float) -> int:
    """Return the steps between two marks of terms of the state, for a control period dt [s]."""
    return max(round(TERM_STRIDE / dt), 1)


def module_source(system: System, cost: Cost, dtype: type) -> str:
    """Return the text of the module with `rollout` for this model and this cost.

    Args:
        system: the model; the text depends on the names of its numbers, not on their values.
        cost: the cost; the text depends on the names of its numbers; terms of weight zero are left
            out.
        dtype: NumPy type of all numbers.

    Raises:
        TraceError: the step or a term uses an operation that cannot be compiled.
    """
    step = _step(system, cost)
    states, numbers = len(system.states), len(cost.row._fields)
    rollout = fill(
        ROLLOUT,
        **step.parts,
        begin=fill(
            BEGIN,
            states=states,
            target_numbers=numbers,
            begin_marks=_marks(cost, BEGIN_MARKS),
        ),
        sum=" + ".join(step.weighted.values()) or "F(0)",
        keep=fill(KEEP, states=states),
        next_targets=next_targets(numbers),
        keep_marks=_marks(cost, KEEP_MARKS),
    )
    return "\n".join([header(dtype), _meet_obstacles(cost), rollout])


def operations(system: System, cost: Cost) -> int:
    """Return the number of arithmetic operations of one step of one sample.

    The operations of control and cost are included, and terms at marks by their share of the steps.
    """
    step = _step(system, cost)
    return step.operations + round(step.at_marks / term_steps(system.dt))


class _Step(NamedTuple):
    """The text of one step of one sample."""

    parts: dict[str, str]  # the parts of ROLLOUT, by the name of their place
    weighted: dict[str, str]  # weight times value of each term with a nonzero weight
    operations: int
    at_marks: int  # operations of the terms at a mark


def _step(system: System, cost: Cost) -> _Step:
    """Return the text of the parts of the loops that depend on control, model and cost."""
    # Trace
    graph = Graph()
    x = graph.record(system.state, "x", "state[{k}, l]")
    crashed_before = graph.input("crashed_before", "crashed[l]")
    target = graph.record(cost.row, "target", "target[{k}, l]")
    graph.section = "the control, within its limits"
    u = system.control(*(_clipped(graph, name, k) for k, name in enumerate(system.controls)))
    x_next = trace_model(graph, system, x, u)
    found = trace_cost(graph, cost, x, x_next, u, target, crashed_before)

    # Write the lines of a step, with names that do not occur in the surrounding text
    parts = {
        "read_plan": _read_plan(system),
        "read_limits": _read_limits(system),
        "read_obstacles": _marks(cost, READ_OBSTACLES),
    }
    loop = (ROLLOUT, BEGIN, STEP, KEEP, NEXT_TARGETS)
    around = (*loop, BEGIN_MARKS, KEEP_MARKS, *parts.values())
    writer = Writer("\n".join(around))
    lines = writer.lines([*flat(x_next), found.crashed, found.reached, *found.weighted.values()])
    parts["step"] = fill(
        STEP,
        lines=lines,
        store_state=store(x_next, "state[{k}, l]", writer),
        crashed=writer(found.crashed),
        is_reached=writer(found.reached),
    )

    # Read the numbers that these lines use
    parts["read_model"] = ""
    if system.params:
        parts["read_model"] = read(type(system.params), "model", "system_numbers[l_t, {k}]", writer)
    text = "\n".join((*around, STATE_TERMS, parts["step"]))
    at_marks = _state_terms(system, cost, text)
    parts["state_terms"] = at_marks.text
    writer.read |= at_marks.read
    parts["read_cost"] = _read_cost(cost, writer)

    weighted = {name: writer(value) for name, value in found.weighted.items()}
    # clip(U + n z) is four operations for each control; each term is added to the sum
    operations = writer.operations + 4 * len(system.controls) + len(weighted)
    return _Step(parts, weighted, operations, at_marks.operations)


class _AtMarks(NamedTuple):
    """The text of the terms of the state."""

    text: str  # "" if there are none
    read: set[str]  # names of the numbers that it reads
    operations: int


def _state_terms(system: System, cost: Cost, around: str) -> _AtMarks:
    """Write the lines of the terms of the state.

    Args:
        system: the model.
        cost: the cost.
        around: the surrounding text, whose names are not used for new variables.
    """
    graph = Graph()
    x = graph.record(system.state, "x", "state[{k}, l]")
    target = graph.record(cost.row, "target", "target[{k}, l]")
    shared = graph.record(type(cost.params), "p") if cost.params else ()
    weighted = []
    for term in cost.terms:
        if not isinstance(term, StateTerm) or not np.any(term.weight):
            continue
        graph.section = f"term: {term.name}"
        own = shared
        if term.parameters:
            own = graph.record(type(term.parameters), f"p_{term.name}")
        value = trace_number(term.function, x, target, own)
        if term.parameters:
            _expect_read(graph, term, own, value)
        weighted.append(_weigh(graph, graph.variable(f"weight_{term.name}"), value))
    if not weighted:
        return _AtMarks("", set(), 0)
    writer = Writer(around)
    lines = writer.lines(weighted)
    text = fill(STATE_TERMS, lines=lines, sum=" + ".join(map(writer, weighted)))
    return _AtMarks(text, writer.read, writer.operations)


def _read_plan(system: System) -> str:
    """Return the lines that read the plan at step t: `plan_thrust = U[t, 3]`."""
    lines = [f"plan_{name} = U[t, {k}]" for k, name in enumerate(system.controls)]
    return "\n".join(lines)


def _read_limits(system: System) -> str:
    """Return the lines that read the control limits: `low_thrust = low[3]`."""
    lines = [
        f"{side}_{name} = {side}[{k}]"
        for side in ("low", "high")
        for k, name in enumerate(system.controls)
    ]
    return "\n".join(lines)


def _read_cost(cost: Cost, writer: Writer) -> str:
    """Return the lines that read weights and parameters: `p_floor = cost_numbers[k_t, 12]`."""
    lines = [
        f"{name} = cost_numbers[k_t, {k}]"
        for k, name in enumerate(cost.number_names)
        if name in writer.read
    ]
    return "\n".join(lines)


def _clipped(graph: Graph, name: str, k: int) -> Symbol:
    """Return control k of a sample, v = clip(U + n z), as an input of the graph."""
    noisy = f"plan_{name} + n_t * block[{k}, t0 + t, l]"
    return graph.input(f"u_{name}", f"lower(higher({noisy}, low_{name}), high_{name})")


def trace_model(graph: Graph, system: System, x: Any, u: Any, params: Any = None) -> Any:
    """Return the next state as symbols, by tracing the model's step.

    Args:
        graph: graph that records the operations.
        system: the model.
        x: record of the state, as symbols.
        u: record of the control, as symbols.
        params: record of the parameters, as symbols; None: variables `model_...` of the
            surrounding text.

    Returns:
        The record of the next state, as symbols.

    Raises:
        TraceError: the step cannot be traced, or does not return a state.
    """
    graph.section = f"{system.name}: {system.step.__name__}"
    if params is None:
        params = graph.record(type(system.params), "model") if system.params else ()
    x_next = trace(system.step, x, u, params, graph.variable("dt"))
    if not isinstance(x_next, system.state):
        raise wrong_result(system.step, f"a {system.state.__name__}", x_next)
    for value in flat(x_next):
        check_number(system.step, value)
    return x_next


class TracedCost(NamedTuple):
    """A cost at one step of one sample, as symbols."""

    crashed: Value  # at least 1.0 from the crash on, else the risks so far
    reached: Value
    weighted: dict[str, Symbol]  # weight times value of each term with a nonzero weight


def trace_cost(
    graph: Graph, cost: Cost, x: Any, x_next: Any, u: Any, target: Any, crashed_before: Symbol
) -> TracedCost:
    """Return the traced terms of a cost, and its functions for reached targets and crashes.

    Parameters and weights are variables of the surrounding text, named as in Cost.number_names.

    Args:
        graph: graph that records the operations.
        cost: the cost.
        x, x_next, u, target: records of state, next state, control and target row, as symbols.
        crashed_before: the sample's crash flag before the step.

    Raises:
        TraceError: one of the functions cannot be traced.
    """
    shared = graph.record(type(cost.params), "p") if cost.params else ()
    crashed: Any = crashed_before
    if cost.crash:
        graph.section = "whether the sample crashes"
        crashes = trace_number(cost.crash, x, x_next, u, target, shared)
        certain = graph.apply("max", crashed_before, 1.0) if cost.risk else 1.0
        crashed = graph.apply("where", crashes, certain, crashed_before)
        crashed.name = crashed.name or "has_crashed"
    if cost.risk:
        graph.section = "the risk of a crash"
        added = trace_number(cost.risk, x, x_next, u, target, shared)
        crashed = graph.apply("add", crashed, added)
    graph.section = "whether it reaches its target"
    reached = trace_number(cost.reached, x, x_next, u, target, shared) if cost.reached else False
    weighted = {}
    for term in cost.terms:
        if not np.any(term.weight) or isinstance(term, StateTerm):
            continue
        graph.section = f"term: {term.name}"
        if term.function is crash:
            value = crashed
        else:
            own = shared
            if term.parameters:
                own = graph.record(type(term.parameters), f"p_{term.name}")
            value = trace_number(term.function, x, x_next, u, target, own)
            if term.parameters:
                _expect_read(graph, term, own, value)
        weight = graph.variable(f"weight_{term.name}")
        weighted[term.name] = _weigh(graph, weight, value)
        weighted[term.name].hint = f"cost_of_{term.name}"
    return TracedCost(crashed, reached, weighted)


def _expect_read(graph: Graph, term: Term, own: Any, value: Value) -> None:
    """Check that a term uses all its parameters, because an unused one may be misspelt.

    Args:
        graph: the graph of the traced term.
        term: the term.
        own: record of the term's parameters, as symbols.
        value: result of the term.

    Raises:
        TraceError: a parameter is not used in any operation.
    """
    read = {arg.number for node in graph.nodes for arg in node.args if isinstance(arg, Symbol)}
    if isinstance(value, Symbol):
        read.add(value.number)
    for name, symbol in own._asdict().items():
        if symbol.number not in read:
            near = did_you_mean(name, ["weight", "name"])
            wanted = "expected parameters that the function reads from p"
            problem = f"{wanted}, got {name!r}, which it does not read: {near}"
            raise TraceError(f"{label(term.function)}: {problem}")


def _weigh(graph: Graph, weight: Symbol, value: Value) -> Symbol:
    """Return weight times value, multiplied from the left: w a b = (w a) b.

    A product that is a variable or the result of a helper function is not split.
    """
    if isinstance(value, Symbol) and value.kind in ("mul", "div") and not value.name:
        left, right = value.args
        is_whole = isinstance(left, Symbol) and left.hint
        weighted = graph.apply("mul", weight, left) if is_whole else _weigh(graph, weight, left)
        return graph.apply(value.kind, weighted, right)
    return graph.apply("mul", weight, value)


def _marks(cost: Cost, template: str) -> str:
    """Return a filled template of marks, "" if the cost has no obstacles."""
    if cost.obstacles is None:
        return ""
    return fill(template, marks=MARKS, boxes=BOXES)


def _meet_obstacles(cost: Cost) -> str:
    """Return the text of the function that tests lines against obstacles, "" if there are none."""
    if cost.obstacles is None:
        return ""
    test = line_test(
        cost.obstacles.touches,
        cost.obstacles.row,
        p0="marked[m - 1, {k}, l]",
        p1="marked[m, {k}, l]",
        around=MEET_OBSTACLES,
    )
    return fill(
        MEET_OBSTACLES,
        marks=MARKS,
        boxes=BOXES,
        read_obstacle=test.read_obstacle,
        lines=test.lines,
        touches=test.touches,
    )
