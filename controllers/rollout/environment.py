"""The text of a generated module that steps many environments: step, gate tests, observation, reward, restart.

The functions are those that a rollout inlines, and like a rollout the loops run over lanes: environment i is lane
i % LANES of block i // LANES. All environments of a block fly one course. What happens rarely (a gate is passed, an
episode ends) sets a flag, and a loop apart handles it. An episode starts from a row of `starts`: the state, the row of
targets, the parameters of the system. Which row is drawn depends on the seed, the environment and the number of the
episode alone, never on threads.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from types import ModuleType

from controllers.rollout import FAST
from controllers.rollout.compiled import load_module
from controllers.rollout.environment_text import ADVANCE, PARTS, RESTART
from controllers.rollout.inline import lane_source
from controllers.rollout.layout import LANES
from controllers.rollout.templates import HEADER

SAME_STEP, NEXT_STEP, DISABLED = 0, 1, 2  # when an episode that has ended starts anew

SLACK = 1e-3  # [m] of a vehicle's room to the obstacles is left to rounding


@cache
def environment_module(
    step: Callable,
    terms: Callable,
    touches: Callable,
    observation: Callable,
    reward: Callable,
    sizes: tuple[int, ...],
    clearance: int,
) -> ModuleType:
    """The compiled loops `begin`, `advance`, `to_rows`, `to_lanes`, from the disk's cache where they were built before.

    sizes: numbers of states, controls, a course's row of targets, those of it that are the cost's, terms, parameters of
    system, cost and reward, of an obstacle, of an observation. clearance: the index of that term.
    """
    source = HEADER.format(dtype="float32", lanes=LANES, fast=sorted(FAST))
    functions = {"step": step, "terms": terms, "touches": touches, "observation": observation, "reward": reward}
    for name, function in functions.items():
        source += "\n" + "\n\n".join(lane_source(function, name).values()) + "\n"
    modes = {"SAME_STEP": SAME_STEP, "NEXT_STEP": NEXT_STEP}
    words = _words(*sizes) | modes | {"clearance": clearance, "slack": SLACK}
    source += (RESTART + PARTS + ADVANCE).format(**words)
    digest = hashlib.sha256(source.encode()).hexdigest()[:16]
    return load_module(f"environment_{digest}", source)


def _words(
    n_x: int, n_u: int, n_row: int, n_target: int, n_terms: int, n_p: int, n_q: int, n_r: int, n_o: int, n_obs: int
) -> dict[str, object]:
    """What depends on the sizes."""

    def row(text: str, n: int, between: str = ", ", first: int = 0) -> str:
        return between.join(text.format(k=k) for k in range(first, n))

    def block(name: str, n: int, first: int = 0) -> str:
        return row(name + "[{k}, l]", n, first=first)

    return {
        "n_x": n_x, "n_u": n_u, "n_row": n_row, "n_target": n_target, "n_gates": n_row - n_target, "n_terms": n_terms,
        "n_p": n_p, "n_obs": n_obs,
        "x": block("X", n_x),
        "x_of_block": block("I", n_x),
        "x_next": block("Y", n_x),
        "a": block("Q", n_target),
        "gates": block("A", n_row, n_target),
        "gates_of_block": block("G", n_row - n_target),
        "P": block("H", n_p),
        "last": block("last", n_u),
        "before": block("E", n_u),
        "d": block("D", n_u),
        "clipped": row("lower(higher(C[{k}, l], F(-1)), F(1))", n_u),
        "command": row("low{k} + (F(1) + d[{k}]) * half{k}", n_u),
        "read_command": row("low{k}, half{k} = low[{k}], half[{k}]", n_u, "; "),
        "store_d": row("D[{k}, l] = d[{k}]", n_u, "; "),
        "store_x": row("Y[{k}, l] = x_next[{k}]", n_x, "; "),
        "store_o": row("O[{k}, l] = o[{k}]", n_obs, "; "),
        "store_obs": row("obs[{k}, l] = o[{k}]", n_obs, "; "),
        "read_Q": row("q{k} = p_cost[c, {k}]", n_q, "; "),
        "Q": row("q{k}", n_q) + ",",
        "read_R": row("r{k} = p_reward[{k}]", n_r, "; "),
        "R": row("r{k}", n_r) + ",",
        "read_box": row("o{k} = obstacles[o, {k}]", 6, "; "),
        "read_obstacle": row("o{k} = obstacles[o, {k}]", n_o, "; ", first=6),
        "obstacle": row("o{k}", n_o) + ",",
    }  # fmt: skip
