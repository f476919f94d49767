"""IPOPT on the program of a task."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi
import numpy as np

from quadsim.limit.detours import Detour
from quadsim.limit.dynamics import Dynamics
from quadsim.limit.guess import Guess
from quadsim.limit.task import Task
from quadsim.limit.transcription import Shooting, shooting, state_scale
from quadsim.record.limits import Solution

ITERATIONS = 1500
SOLVED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")
OPTIONS = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",  # no banner on stdout
    "ipopt.max_iter": ITERATIONS,
    "ipopt.tol": 1e-5,
    "ipopt.mu_strategy": "adaptive",
}
Show = Callable[[int, float], None]  # iteration, time of the race so far [s]


class NotSolvedError(Exception):
    """The optimiser gave up. One line: its own word for why."""


class Watch(casadi.Callback):
    """Tells after each iteration where the optimiser is; an exception in `show` stops it."""

    def __init__(self, n: int, m: int, show: Show):
        casadi.Callback.__init__(self)
        self._shapes, self._show, self._count, self.raised = (n, m), show, 0, None
        self.construct("watch", {})

    def get_n_in(self) -> int:
        return casadi.nlpsol_n_out()

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, i: int) -> str:
        return casadi.nlpsol_out(i)

    def get_sparsity_in(self, i: int) -> casadi.Sparsity:
        n, m = self._shapes
        size = {"x": n, "lam_x": n, "f": 1, "g": m, "lam_g": m}.get(casadi.nlpsol_out(i), 0)
        return casadi.Sparsity.dense(size, 1 if size else 0)

    def eval(self, arg: Sequence[Any]) -> list[int]:
        try:
            self._show(self._count, float(arg[1]))
            self._count += 1
        except BaseException as error:  # through compiled code it would be lost
            self.raised = error
            return [1]
        return [0]


def solve(
    task: Task,
    model: Dynamics,
    nodes: list[int],
    guess: Guess,
    show: Show | None = None,
    around: Sequence[Detour] = (),
) -> Solution:
    """nodes: intervals on the way to each of `task.points` but the first; around: frames beside the
    targets.

    Raises NotSolvedError, and what `show` raises.
    """
    s = shooting(task, model, nodes, guess, around)
    lengths = np.array([segment.intervals for segment in s.plan])
    z, g = casadi.vertcat(*s.program.z), casadi.vertcat(*s.program.g)
    time = casadi.dot(casadi.DM(lengths), casadi.vertcat(*s.h))
    watch = Watch(z.shape[0], g.shape[0], show or (lambda iteration, time: None))
    options = OPTIONS | {"iteration_callback": watch}
    solver = casadi.nlpsol("limit", "ipopt", {"x": z, "f": time, "g": g}, options)
    p = s.program
    found = solver(x0=p.start, lbx=p.low, ubx=p.high, lbg=p.g_low, ubg=p.g_high)
    if watch.raised:
        raise watch.raised
    if (status := solver.stats()["return_status"]) not in SOLVED:
        raise NotSolvedError(status.replace("_", " ").lower())
    return _read(s, z, found, lengths)


def _read(s: Shooting, z: casadi.MX, found: dict, lengths: np.ndarray) -> Solution:
    read = casadi.Function(
        "read", [z], [casadi.horzcat(*s.x), casadi.horzcat(*s.u), casadi.vertcat(*s.h)]
    )
    x, u, h = (np.array(part) for part in read(found["x"]))
    multipliers = np.array(found["lam_g"]).ravel()
    costate = np.array([multipliers[d] for d in s.defects]) / state_scale(s.model)
    t = np.append(0.0, np.cumsum(np.repeat(h.ravel(), lengths)))
    return Solution(
        s.model.name,
        t,
        x.T,
        u.T,
        costate,
        np.repeat([segment.target for segment in s.plan], lengths),
    )
