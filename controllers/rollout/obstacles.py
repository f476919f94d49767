"""Obstacles in the generated loops: straight lines between positions some steps apart, against each obstacle near them.

Positions are kept every `stride` steps. When there are MARKS of them, boxes around them, each of some lanes of the
block, pick the obstacles: most blocks are near none. A sample that touched one pays for the crash from the end of that
line on, as if it had been noticed there.
"""

from __future__ import annotations

from collections.abc import Callable

from controllers.rollout.inline import lane_source

MARKS = 4  # positions between which lines are tested at once
STRIDE = 0.04  # [s] from one to the next
BOXES = 16  # boxes around the positions of a block, each of every sixteenth lane: as many as a vector has numbers

TESTS = """
@njit(fastmath=FAST, error_model="numpy")
def meet_obstacles(marked, low, high, obstacles, stride, weight, before_finish, crashed, cost):
    for k in range(3):
        for l in range({boxes}):
            low[k, l] = {lowest}
            high[k, l] = {highest}
    for o in range(obstacles.shape[0]):
        {read}
        near = np.int32(0)
        for l in range({boxes}):
            near_x = (low[0, l] <= o3) & (high[0, l] >= o0)
            near_y = (low[1, l] <= o4) & (high[1, l] >= o1)
            near_z = (low[2, l] <= o5) & (high[2, l] >= o2)
            near |= np.int32(1) if near_x & near_y & near_z else np.int32(0)
        if near == 0:
            continue
        for m in range(1, {marks}):
            due = weight * F(({marks} - 1 - m) * stride + 1)
            for l in range(L):
                p0 = (marked[m - 1, 0, l], marked[m - 1, 1, l], marked[m - 1, 2, l])
                p1 = (marked[m, 0, l], marked[m, 1, l], marked[m, 2, l])
                new = select(touches(p0, p1, ({row})), F(1) - crashed[l], F(0)) * before_finish[l]
                crashed[l] += new
                cost[l] += due * new
    for k in range(3):
        for l in range(L):
            marked[0, k, l] = marked[{marks} - 1, k, l]
"""

BEGIN = """
marked = np.empty(({marks}, 3, L), F)
corner, opposite = np.empty((3, {boxes}), F), np.empty((3, {boxes}), F)
before_finish = np.full(L, F(1) if last > 0 else F(0))
marks, until_mark = 1, stride
for k in range(3):
    marked[0, k, :] = x0[k]
"""

KEEP = """
until_mark -= 1
if until_mark == 0 or t == T - 1:
    until_mark = stride
    filled = {marks} if t == T - 1 else marks + 1  # at the end the last position fills what is left
    for m in range(marks, filled):
        for k in range(3):
            for l in range(L):
                marked[m, k, l] = X[k, l]
    marks = filled
    if marks == {marks}:
        meet_obstacles(marked, corner, opposite, obstacles, stride, weight, before_finish, crashed, {cost})
        marks = 1
        for l in range(L):
            before_finish[l] = F(1) if row[l] < last else F(0)
"""


def steps_between(dt: float) -> int:
    """Steps from one mark to the next."""
    return max(round(STRIDE / dt), 1)


def obstacle_words(touches: Callable | None, numbers: int, lanes: int) -> dict[str, str]:
    """What the templates of the loops insert: the tests, their arguments, the marks; nothing without obstacles.

    numbers: of an obstacle's row.
    """
    if touches is None:
        return dict.fromkeys(("tests", "arguments", "begin_marks", "keep_rollout", "keep_paths"), "")
    boxes, row = min(lanes, BOXES), ", ".join(f"o{k}" for k in range(numbers))
    kept = [f"marked[{m}, k, l + {first}]" for m in range(MARKS) for first in range(0, lanes, boxes)]
    tests = TESTS.format(
        boxes=boxes,
        lowest=folded("lower", kept),
        highest=folded("higher", kept),
        read=f"{row} = {', '.join(f'obstacles[o, {k}]' for k in range(numbers))}",
        row=row,
        marks=MARKS,
    )
    return {
        "tests": "\n\n".join(lane_source(touches, "touches").values()) + "\n" + tests,
        "arguments": ", obstacles, stride, term, weight",
        "begin_marks": BEGIN.format(marks=MARKS, boxes=boxes),
        "keep_rollout": KEEP.format(marks=MARKS, cost="cost"),
        "keep_paths": KEEP.format(marks=MARKS, cost="means[term]"),
    }


def folded(function: str, of: list[str]) -> str:
    """One expression of a function of two arguments over many."""
    if len(of) == 1:
        return of[0]
    middle = len(of) // 2
    return f"{function}({folded(function, of[:middle])}, {folded(function, of[middle:])})"
