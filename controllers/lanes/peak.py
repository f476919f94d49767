"""The processor's peak: the most arithmetic operations that one thread does in a second.

The loop multiplies and adds numbers that stay in the registers, in as wide vectors as the compiler
uses for the rollouts. It does nothing else, so no loop of the planner does more in the same time.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np
from numba import njit

from quadsim.controllers.lanes import FAST
from quadsim.controllers.lanes.compiled import kept
from quadsim.controllers.lanes.layout import LANES

# Multiply-adds in a row on each number: as many as hide the loads and stores, and few enough that
# the processor begins with the next numbers before they are done
CHAIN = 16
ROUNDS = 20_000
REPEATS = 7  # measurements, of which the fastest counts


@kept
@njit(fastmath=FAST, error_model="numpy", nogil=True)
def multiply_and_add(numbers, factor, summand, rounds):
    """Replace each number by number * factor + summand, CHAIN times in each round."""
    for _ in range(rounds):
        for k in range(len(numbers)):
            number = numbers[k]
            for _ in range(CHAIN):
                number = number * factor + summand
            numbers[k] = number


def peak_operations() -> float:
    """Return the measured peak of one thread, in multiplications and additions per second."""
    numbers = np.ones(2 * LANES, np.float32)
    # A fixed point at 1, so that the numbers stay as they are
    factor, summand = np.float32(0.5), np.float32(0.5)
    multiply_and_add(numbers, factor, summand, 1)  # compiles
    operations = 2 * CHAIN * ROUNDS * len(numbers)
    times = []
    for _ in range(REPEATS):
        began = perf_counter()
        multiply_and_add(numbers, factor, summand, ROUNDS)
        times.append(perf_counter() - began)
    return operations / min(times)
