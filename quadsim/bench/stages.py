"""Time the parts of a control step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from time import perf_counter
from typing import NamedTuple
from unittest.mock import patch

import numpy as np

from quadsim.bench.cases import Case, Start, median_ms, starting, times_ms
from quadsim.controllers import mppi as algorithm
from quadsim.controllers.lanes.layout import chunks
from quadsim.controllers.lanes.normals import fill_normals
from quadsim.controllers.mppi import MPPI


class PartTime(NamedTuple):
    """The time that a part of one iteration takes."""

    name: str  # name of the case
    sampler: str
    part: str
    ms: float


def stages(case: Case, seconds: float) -> list[PartTime]:
    """Return the time of each part of one iteration, and of the whole."""
    parts = parts_ms(starting(case), case.sampler, seconds)
    return [PartTime(case.name, case.sampler, part, ms) for part, ms in parts.items()]


def parts_ms(start: Start, sampler: str, seconds: float) -> dict[str, float]:
    """Return the median time of each part of one iteration [ms].

    `rest` is the whole minus its parts, and may be negative, because the medians are independent.
    Colored noise is made in one loop: `normals` is the time of drawing the same number of normals
    alone, and `transform` is the rest of the loop's time.
    """
    mppi = start.mppi
    noise_of_colored = {}
    if sampler == "colored":
        noise_of_colored["normals"] = normals_ms(mppi, seconds)

    # Time the parts within whole control steps, with realistic caches.
    taken: list[list[float]] = []
    with timed_parts(mppi) as parts:

        def control() -> None:
            parts.update(dict.fromkeys(parts, 0.0))
            mppi.control(start.x)
            taken.append(list(parts.values()))

        whole = times_ms(control, seconds)

    # The warm-up calls come first and do not count.
    iterations = mppi.config.iterations
    medians = np.median(taken[-len(whole) :], axis=0) / iterations
    ms = dict(zip(parts, medians.tolist(), strict=True))
    total = float(np.median(whole)) / iterations
    rest = total - sum(ms.values())

    # Split the noise of colored sampling in two.
    noise = ms.pop("noise")
    if noise_of_colored:
        noise_parts = noise_of_colored | {"transform": noise - noise_of_colored["normals"]}
    else:
        noise_parts = {"normals": noise}
    return noise_parts | ms | {"rest": rest, "whole": total}


@contextmanager
def timed_parts(mppi: MPPI) -> Iterator[dict[str, float]]:
    """Time the functions of an iteration at their calls, over all its chunks.

    Yields the time spent in each part since the dictionary's values were last set to 0 [ms].
    """
    ms: dict[str, float] = {}

    def timed(part: str, call: Callable) -> Callable:
        ms[part] = 0.0

        def call_and_add(*arguments: object) -> object:
            began = perf_counter()
            result = call(*arguments)
            ms[part] += 1e3 * (perf_counter() - began)
            return result

        return call_and_add

    sampler = replace(mppi.sampler, sample=timed("noise", mppi.sampler.sample))
    with ExitStack() as patches:
        patches.enter_context(patch.object(mppi, "sampler", sampler))
        for part, owner, name in (
            ("rollouts", mppi, "rollout"),
            ("weights", algorithm, "softmax_weights"),
            ("weights", algorithm, "weights"),
            ("weighted mean", algorithm, "weighted_mean"),
        ):
            patches.enter_context(patch.object(owner, name, timed(part, getattr(owner, name))))
        yield ms


def normals_ms(mppi: MPPI, seconds: float) -> float:
    """Return the time of the normals for one iteration's noise [ms].

    The normals are drawn chunk after chunk in the sampler's own memory. With the method exact and
    no cut-off, two series of n = 2T steps need 2n normals per channel.
    """
    key = np.zeros(2, np.uint32)
    parts = chunks(mppi.samples)
    noise = [mppi.sampler.sample(0, part.start, part.stop - part.start) for part in parts]
    rows = [z.reshape(len(z), -1, z.shape[-1]) for z in noise]  # views
    drawn = round(mppi.sampler.normals * rows[0].shape[1])
    rows = [of_part[:, :drawn] for of_part in rows]
    scale = np.ones(rows[0].shape[1], np.float32)

    def fill() -> None:
        for out in rows:
            fill_normals(out, scale, key, 0, 0)

    return median_ms(fill, seconds)
