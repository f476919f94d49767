"""Where the time of a control step goes, beside what the machine needs for it at least."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from time import perf_counter

import numpy as np

from controllers import mppi as algorithm
from controllers.mppi import MPPI
from controllers.rollout.layout import chunks
from controllers.rollout.normals import fill_normals
from quadsim.app.bench.cases import Case, controller
from quadsim.app.bench.timing import median_ms, times_ms
from quadsim.app.bench.work import Machine, floor_ns, work


def stages(case: Case, seconds: float, machine: Machine) -> Iterator[dict]:
    """{name, sampler, part, ms, operations, bytes, roofline} of each part of one iteration, and of the whole."""
    mppi, x = controller(case)
    todo = work(mppi, case.sampler)
    for part, ms in parts_ms(mppi, x, case.sampler, seconds).items():
        row = {"name": f"{case.system} {case.size}", "sampler": case.sampler, "part": part, "ms": ms}
        if part in todo:
            floor_ms = 1e-6 * case.samples * case.horizon * floor_ns(todo[part], machine)
            row |= {"operations": todo[part].operations, "bytes": todo[part].bytes, "roofline": floor_ms / ms}
        yield row


def parts_ms(mppi: MPPI, x: np.ndarray, sampler: str, seconds: float) -> dict[str, float]:
    """Of one iteration, medians. `rest` is the whole less its parts; below zero where their medians do not agree.

    Colored noise comes from one loop, of which as many normals made alone are a part, the transform the rest.
    """
    normals = {"normals": normals_ms(mppi, seconds)} if sampler == "colored" else {}
    taken: list[list[float]] = []
    with timed_parts(mppi) as parts:

        def control() -> None:
            mppi.control(x)
            taken.append([part.read() for part in parts.values()])

        whole = times_ms(control, seconds)
    medians = np.median(taken[-len(whole) :], axis=0) / mppi.config.iterations
    ms = dict(zip(parts, medians.tolist(), strict=True))
    noise, total = ms.pop("noise"), float(np.median(whole)) / mppi.config.iterations
    noise_ms = normals | {"transform": noise - normals["normals"]} if normals else {"normals": noise}
    return noise_ms | ms | {"rest": total - noise - sum(ms.values()), "whole": total}


class Clock:
    """How long the functions that it was put around have taken."""

    def __init__(self) -> None:
        self._ms = 0.0

    def around(self, call: Callable) -> Callable:
        def timed(*arguments: object) -> object:
            began = perf_counter()
            result = call(*arguments)
            self._ms += 1e3 * (perf_counter() - began)
            return result

        return timed

    def read(self) -> float:
        """Since the last reading [ms]."""
        ms, self._ms = self._ms, 0.0
        return ms


@contextmanager
def timed_parts(mppi: MPPI) -> Iterator[dict[str, Clock]]:
    """What an iteration calls, timed where it is called: over all its chunks, with the caches as they are there."""
    places = [
        ("rollouts", mppi, "rollout"),
        ("weights", algorithm, "shares"),
        ("weights", algorithm, "weights"),
        ("weighted mean", algorithm, "weighted_mean"),
    ]
    plain = [getattr(owner, name) for _, owner, name in places]
    clocks = {part: Clock() for part in ("noise", *(part for part, _, _ in places))}
    sampler = mppi.sampler
    mppi.sampler = replace(sampler, sample=clocks["noise"].around(sampler.sample))
    for (part, owner, name), call in zip(places, plain, strict=True):
        setattr(owner, name, clocks[part].around(call))
    try:
        yield clocks
    finally:
        mppi.sampler = sampler
        for (_, owner, name), call in zip(places, plain, strict=True):
            setattr(owner, name, call)


def normals_ms(mppi: MPPI, seconds: float) -> float:
    """As many normals as one iteration's noise has numbers, chunk after chunk in the sampler's own memory.

    Law exact: two series of n = 2 T steps come from 2 n normals a channel.
    """
    key, parts = np.zeros(2, np.uint32), chunks(mppi.samples)
    noise = [mppi.sampler.sample(0, part.start, part.stop - part.start) for part in parts]
    rows = [z.reshape(len(z), -1, z.shape[-1]) for z in noise]  # views
    scale = np.ones(rows[0].shape[1], np.float32)
    return median_ms(lambda: [fill_normals(out, scale, key, 0, 0) for out in rows], seconds)
