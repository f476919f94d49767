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
from controllers.rollout.inline import lane_source
from controllers.rollout.layout import LANES
from controllers.rollout.templates import HEADER

SAME_STEP, NEXT_STEP, DISABLED = 0, 1, 2  # when an episode that has ended starts anew

RESTART = """
from controllers.rollout.normals import normal_rows

@njit(fastmath=FAST, error_model="numpy")
def drawn(seed, environment, episode, of):
    h = np.uint64(seed) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(environment) * np.uint64(0xD1B54A32D192ED03)
    h += np.uint64(episode) * np.uint64(0x8CB92BA72F3D8DD7)
    h = (h ^ (h >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.int64((h ^ (h >> np.uint64(31))) % np.uint64(of))

@njit(fastmath=FAST, error_model="numpy")
def restart(l, environment, seed, starts, targets, X, A, P, last, row, steps, passes, episode):
    s = starts[drawn(seed, environment, episode[l], starts.shape[0])]
    for k in range({n_x}):
        X[k, l] = s[k]
    row[l] = np.int32(s[{n_x}])
    for k in range({n_p}):
        P[k, l] = s[{n_x} + 1 + k]
    for k in range({n_u}):
        last[k, l] = s[{n_x} + 1 + {n_p} + k]
    for k in range({n_row}):
        A[k, l] = targets[row[l], k]
    steps[l] = 0
    passes[l] = 0
    episode[l] += 1

@njit(fastmath=FAST, error_model="numpy")
def observe(X, A, last, obs):
    found = np.empty(({n_obs}, L), F)
    for l in range(L):
        x = ({x},)
        o = observation(x, ({gates},), ({last},))
        {store_found}
    obs[:] = found

@kept
@njit(fastmath=FAST, error_model="numpy", parallel=True)
def begin(X, A, P, last, way, row, steps, passes, episode, over, obs, starts, targets, course, seed, chosen):
    for b in prange(X.shape[0]):
        for l in range(L):
            if chosen[b, l]:
                restart(l, b * L + l, seed, starts[course[b]], targets[course[b]], X[b], A[b], P[b], last[b], row[b],
                        steps[b], passes[b], episode[b])
                over[b, l] = False
        observe(X[b], A[b], last[b], obs[b])
"""

ADVANCE = """
@njit(fastmath=FAST, error_model="numpy")
def fly(X, A, P, way, steps, actions, act, before, progress, clearance, crashed, hit, p_cost, low, half, dt):
    {read_Q}
    # new arrays, as the compiler knows that they overlap with no other: it vectorises only then
    Y, D, marks = np.empty(({n_x}, L), F), np.empty(({n_u}, L), F), np.empty((3, L), F)
    reached = np.empty(L, np.int32)
    for l in range(L):
        x = ({x},)
        d = ({clipped},)
        u = ({command},)
        x_next = step(x, u, ({P},), dt)
        q = terms(x, x_next, u, ({a},), F(0), ({Q}))
        {store_x}
        {store_d}
        marks[0, l], marks[1, l], marks[2, l] = q[0], q[{clearance}], q[{n_terms} + 1]
        reached[l] = np.int32(1) if q[{n_terms}] else np.int32(0)
    for l in range(L):
        progress[l] = way[l] - marks[0, l] if steps[l] > 0 else F(0)
        way[l], clearance[l], crashed[l], hit[l] = marks[0, l], marks[1, l], marks[2, l], reached[l]
    before[:] = X[:3]
    X[:] = Y
    act[:] = D

@njit(fastmath=FAST, error_model="numpy")
def meet_obstacles(X, before, crashed, obstacles):
    touched = crashed.copy()
    for o in range(obstacles.shape[0]):
        {read_obstacle}
        for l in range(L):
            p0, p1 = (before[0, l], before[1, l], before[2, l]), (X[0, l], X[1, l], X[2, l])
            touched[l] = select(touches(p0, p1, ({obstacle})), F(1), touched[l])
    crashed[:] = touched

@njit(fastmath=FAST, error_model="numpy")
def pay(act, last, progress, clearance, crashed, hit, p_reward, reward_of):
    {read_R}
    for l in range(L):
        d = ({act},)
        reward_of[l] = reward(progress[l], clearance[l], crashed[l], F(hit[l]), d, ({last},), ({R}))
        {store_last}

@njit(fastmath=FAST, error_model="numpy")
def add_noise(obs, noise, lane, key, call):
    drawn_noise = np.empty(({n_obs}, L), F)
    normal_rows(drawn_noise, noise, lane, 0, key, call)
    for k in range({n_obs}):
        for l in range(L):
            obs[k, l] += drawn_noise[k, l]

@kept
@njit(fastmath=FAST, error_model="numpy", parallel=True)
def advance(X, A, P, last, way, row, steps, passes, episode, over, obs, starts, targets, course, seed, p_cost, dt,
            actions, final, reward_of, ended, cut, hit_of, crash_of, final_row, obstacles, n_obstacles, low, half,
            limit, mode, p_reward, noise, key, call):
    for b in prange(X.shape[0]):
        c = course[b]
        before, act = np.empty((3, L), F), np.empty(({n_u}, L), F)
        progress, clearance, crashed = np.empty(L, F), np.empty(L, F), np.empty(L, F)
        hit = np.empty(L, np.int32)
        fly(X[b], A[b], P[b], way[b], steps[b], actions[b], act, before, progress, clearance, crashed, hit, p_cost[c],
            low, half, dt)
        meet_obstacles(X[b], before, crashed, obstacles[c, : n_obstacles[c]])
        pay(act, last[b], progress, clearance, crashed, hit, p_reward, reward_of[b])
        next_targets(A[b], row[b], passes[b], hit, targets[c], final_row[c])
        observe(X[b], A[b], last[b], obs[b])
        if judge(steps[b], row[b], crashed, hit, over[b], ended[b], cut[b], hit_of[b], crash_of[b], final_row[c],
                 limit):
            anew = False
            for l in range(L):
                if over[b, l] and mode == {NEXT_STEP}:
                    ended[b, l], cut[b, l], hit_of[b, l], crash_of[b, l] = False, False, False, False
                    reward_of[b, l] = F(0)
                done = ended[b, l] or cut[b, l]
                again = done if mode == {SAME_STEP} else over[b, l] and mode == {NEXT_STEP}
                over[b, l] = done and mode != {SAME_STEP}
                if done and mode == {SAME_STEP}:
                    for k in range({n_obs}):
                        final[b, k, l] = obs[b, k, l]
                if again:
                    anew = True
                    restart(l, b * L + l, seed, starts[c], targets[c], X[b], A[b], P[b], last[b], row[b], steps[b],
                            passes[b], episode[b])
            if anew:
                observe(X[b], A[b], last[b], obs[b])
        if noise[0] >= F(0):
            add_noise(obs[b], noise, b * L, key, call)

@njit(fastmath=FAST, error_model="numpy")
def next_targets(A, row, passes, hit, targets, final_row):
    hits = np.int32(0)
    for l in range(L):
        hits |= hit[l]
    if hits > 0:
        for l in range(L):
            if hit[l] > 0 and row[l] < final_row:
                row[l] += 1
                passes[l] += 1
                for k in range({n_row}):
                    A[k, l] = targets[row[l], k]

@njit(fastmath=FAST, error_model="numpy")
def judge(steps, row, crashed, hit, over, ended, cut, hit_of, crash_of, final_row, limit):
    rare = False
    for l in range(L):
        steps[l] += np.int32(1)
        ended[l] = (crashed[l] > F(0)) | (row[l] >= final_row)
        cut[l] = (steps[l] >= limit) & (not ended[l])
        hit_of[l] = hit[l] > 0
        crash_of[l] = crashed[l] > F(0)
        rare |= ended[l] | cut[l] | over[l]
    return rare

@kept
@njit(parallel=True)
def to_rows(lanes, rows):
    for b in prange(lanes.shape[0]):
        for l in range(min(L, rows.shape[0] - b * L)):
            for k in range(rows.shape[1]):
                rows[b * L + l, k] = lanes[b, k, l]

@kept
@njit(parallel=True)
def to_lanes(rows, lanes):
    for b in prange(lanes.shape[0]):
        for l in range(min(L, rows.shape[0] - b * L)):
            for k in range(rows.shape[1]):
                lanes[b, k, l] = rows[b * L + l, k]
"""


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
    words = _words(*sizes) | {"clearance": clearance, "SAME_STEP": SAME_STEP, "NEXT_STEP": NEXT_STEP}
    source += RESTART.format(**words) + ADVANCE.format(**words)
    digest = hashlib.sha256(source.encode()).hexdigest()[:16]
    return load_module(f"environment_{digest}", source)


def _words(
    n_x: int, n_u: int, n_row: int, n_target: int, n_terms: int, n_p: int, n_q: int, n_r: int, n_o: int, n_obs: int
) -> dict[str, object]:
    """What depends on the sizes."""

    def row(text: str, n: int, between: str = ", ", first: int = 0) -> str:
        return between.join(text.format(k=k) for k in range(first, n))

    clipped = "lower(higher(actions[{k}, l], F(-1)), F(1))"
    return {
        "n_x": n_x, "n_u": n_u, "n_row": n_row, "n_terms": n_terms, "n_p": n_p, "n_obs": n_obs,
        "x": row("X[{k}, l]", n_x),
        "a": row("A[{k}, l]", n_target),
        "gates": row("A[{k}, l]", n_row, first=n_target),
        "P": row("P[{k}, l]", n_p),
        "last": row("last[{k}, l]", n_u),
        "clipped": row(clipped, n_u),
        "command": row("low[{k}] + (F(1) + d[{k}]) * half[{k}]", n_u),
        "act": row("act[{k}, l]", n_u),
        "store_d": row("D[{k}, l] = d[{k}]", n_u, "; "),
        "store_last": row("last[{k}, l] = act[{k}, l]", n_u, "; "),
        "store_x": row("Y[{k}, l] = x_next[{k}]", n_x, "; "),
        "store_found": row("found[{k}, l] = o[{k}]", n_obs, "; "),
        "read_Q": f"{row('q{k}', n_q)}, = {row('p_cost[{k}]', n_q)},",
        "Q": row("q{k}", n_q) + ",",
        "read_R": f"{row('r{k}', n_r)}, = {row('p_reward[{k}]', n_r)},",
        "R": row("r{k}", n_r) + ",",
        "read_obstacle": f"{row('o{k}', n_o)}, = {row('obstacles[o, {k}]', n_o)},",
        "obstacle": row("o{k}", n_o) + ",",
    }  # fmt: skip
