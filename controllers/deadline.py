"""A deadline for plans: fewer samples after a late plan, more samples after an early plan."""

from __future__ import annotations

from quadsim.controllers.lanes.layout import LANES

ROOM = 0.8  # share of the deadline below which the samples may grow again
SHRINK = 0.8  # factor on the samples after a late plan
GROW = 1.05  # factor on the samples after an early plan


def next_samples(samples: int, most: int, plan_ms: float, deadline_ms: float) -> int:
    """Return the number of samples of the next plan.

    It lies between one block of lanes and `most`. Samples come in whole blocks, so that a smaller
    number is never slower than a larger one.

    Args:
        samples: number of samples of the last plan.
        most: largest number of samples.
        plan_ms: time that the last plan took [ms].
        deadline_ms: time allowed for one plan [ms].
    """
    if plan_ms > deadline_ms:
        fewer = int(samples * SHRINK) // LANES * LANES
        return max(fewer, min(LANES, most))
    if plan_ms < ROOM * deadline_ms:
        more = -(-int(samples * GROW + 1) // LANES) * LANES
        return min(more, most)
    return samples
