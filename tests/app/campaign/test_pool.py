"""A lost worker's attempt is flown again, once; nothing is flown twice, nothing forgotten."""

import multiprocessing as mp
import os
import signal
from concurrent.futures import BrokenExecutor, Future
from threading import Lock, Timer

import pytest

from quadsim.app.campaign.pool import Processes, fly_all
from tests.campaign_cases import specs


class Scripted:
    """A pool that loses the worker of some seeds, so many times; all that flies beside is lost with it."""

    lost = (BrokenExecutor,)
    window = 3

    def __init__(self, losses: dict[int, int]):
        self.losses, self.flown, self.lock = losses, [], Lock()
        self.under_way: list[tuple[Future, int]] = []

    def submit(self, spec) -> Future:
        future: Future = Future()
        with self.lock:
            self.under_way.append((future, spec.seed))
            self.flown.append(spec.seed)
        Timer(0.02, self.land).start()
        return future

    def land(self):
        with self.lock:
            landing, self.under_way = self.under_way, []
        dead = [seed for _, seed in landing if self.losses.get(seed)]
        for seed in dead:
            self.losses[seed] -= 1
        for future, seed in landing:
            self.end(future, seed, dead)

    def end(self, future, seed, dead):
        if dead:
            future.set_exception(BrokenExecutor())
        else:
            future.set_result(seed)


def test_a_lost_attempt_is_flown_again_alone_and_those_beside_it_too():
    pool = Scripted({1: 1})
    landed = {spec.seed: flown for spec, flown in fly_all(pool, specs(6))}
    assert landed == {s: s for s in range(6)}
    assert max(map(pool.flown.count, range(6))) == 2


def test_an_attempt_that_always_loses_its_worker_is_given_up_and_takes_no_other_with_it():
    pool = Scripted({1: 99})
    landed = {spec.seed: flown for spec, flown in fly_all(pool, specs(6))}
    assert landed == {s: None if s == 1 else s for s in range(6)}
    assert pool.flown.count(1) == 2


def test_what_an_attempt_raises_comes_out():
    pool = Scripted({})
    pool.end = lambda future, *_: future.set_exception(ValueError("expected more"))
    with pytest.raises(ValueError, match="expected more"):
        list(fly_all(pool, specs(3)))


def test_killing_a_worker_in_mid_campaign_loses_nothing():
    landed = []
    with Processes(2) as pool:
        for spec, flown in fly_all(pool, specs(12)):
            landed.append((spec.seed, flown.run.outcome))
            if len(landed) == 2:
                os.kill(mp.active_children()[0].pid, signal.SIGKILL)
    assert sorted(landed) == [(s, "timeout") for s in range(12)]
    assert not mp.active_children(), "no worker stays behind"
