"""Where the time of a control step goes, beside the least time that this machine needs for each
part."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from time import perf_counter
from unittest.mock import patch

import numpy as np

from controllers import mppi as algorithm
from controllers.lanes.layout import chunks
from controllers.lanes.normals import fill_normals
from controllers.mppi import MPPI
from quadsim.bench.cases import Case, controller, median_ms, times_ms
from quadsim.bench.machine import Machine, floor_ns, work


def stages(case: Case, seconds: float, machine: Machine) -> Iterator[dict]:
    """{name, sampler, part, ms, operations, bytes, roofline} of each part of one iteration, and of
    the whole."""
    mppi, x = controller(case)
    todo = work(mppi, case.sampler)
    for part, ms in parts_ms(mppi, x, case.sampler, seconds).items():
        row = {"name": case.name, "sampler": case.sampler, "part": part, "ms": ms}
        if part in todo:
            floor_ms = 1e-6 * case.samples * case.horizon * floor_ns(todo[part], machine)
            row |= {
                "operations": todo[part].operations,
                "bytes": todo[part].bytes,
                "roofline": floor_ms / ms,
            }
        yield row


def parts_ms(mppi: MPPI, x: np.ndarray, sampler: str, seconds: float) -> dict[str, float]:
    """Of one iteration, medians. `rest` is the whole less its parts; below zero where their medians
    do not agree.

    Colored noise is made in one loop: the time of as many normals alone is given as `normals`, the
    rest of the loop's time as `transform`.
    """
    normals = {"normals": normals_ms(mppi, seconds)} if sampler == "colored" else {}
    taken: list[list[float]] = []
    with timed_parts(mppi) as parts:

        def control() -> None:
            parts.update(dict.fromkeys(parts, 0.0))
            mppi.control(x)
            taken.append(list(parts.values()))

        whole = times_ms(control, seconds)
    medians = np.median(taken[-len(whole) :], axis=0) / mppi.config.iterations
    ms = dict(zip(parts, medians.tolist(), strict=True))
    noise, total = ms.pop("noise"), float(np.median(whole)) / mppi.config.iterations
    noise_ms = (
        normals | {"transform": noise - normals["normals"]} if normals else {"normals": noise}
    )
    return noise_ms | ms | {"rest": total - noise - sum(ms.values()), "whole": total}


@contextmanager
def timed_parts(mppi: MPPI) -> Iterator[dict[str, float]]:
    """The time spent in each part since the dictionary's values were last set to 0 [ms].

    The functions are timed where an iteration calls them: over all its chunks, with the caches as
    they are there.
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
    """As many normals as one iteration's noise has numbers, chunk after chunk in the sampler's own
    memory.

    Method exact: two series of n = 2 T steps come from 2 n normals a channel.
    """
    key, parts = np.zeros(2, np.uint32), chunks(mppi.samples)
    noise = [mppi.sampler.sample(0, part.start, part.stop - part.start) for part in parts]
    rows = [z.reshape(len(z), -1, z.shape[-1]) for z in noise]  # views
    scale = np.ones(rows[0].shape[1], np.float32)
    return median_ms(lambda: [fill_normals(out, scale, key, 0, 0) for out in rows], seconds)
