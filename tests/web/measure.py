"""What a page costs, measured on a quiet machine; no test, as it takes minutes and the machine to
itself.

python tests/web/measure.py slowdown   plan time with four clients watching against none: less than
10 % more python tests/web/measure.py air        from one click to the second frame: less than 5 s
python tests/web/measure.py soak 30    memory and threads over 30 minutes of flights: flat
"""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from wire import connect

from web.flight_factory import Choices, FlightFactory
from web.page.dashboard import Dashboard
from web.page.guard import serve
from web.page.race_panel import Menu
from web.race import Race
from web.session import Session

CLIENTS = 4
SOAK_SAMPLES = 512  # what may grow is the page, not the planner
MENU = Menu(("split_s_swift",), ("swift",), {"race": "swift"}, ("colored", "gaussian"))


class Place:
    """A page on a session, and clients of it in a process of their own."""

    def __init__(self, root: str):
        self.server = serve("127.0.0.1", 0, None, "race")
        self.session = Session(FlightFactory(), root)
        self.page = Dashboard(self.server, self.session, FlightFactory(), MENU, Choices())
        self._watchers: subprocess.Popen | None = None

    def watch(self, on: bool) -> None:
        """Open CLIENTS connections, or close them."""
        if self._watchers:
            self._watchers.kill()
            self._watchers.wait()
            self._watchers = None
        if on:
            self._watchers = subprocess.Popen(
                [sys.executable, __file__, "watch", str(self.server.get_port())]
            )
        while len(self.server.get_clients()) != CLIENTS * on:
            time.sleep(0.05)

    def flight(self, laps: int = 1, samples: int | None = None) -> float:
        """Median plan time of a flight in real time [ms]."""
        races = self.session.snapshot.race
        numbers = {"samples": samples} if samples else {}
        self.session.tell(Race.start, [Choices(laps=laps, numbers=numbers)])
        while self.session.snapshot.race == races or self.session.snapshot.flying:
            time.sleep(0.05)
        return float(np.median(self.session.snapshot.competitors[0].x["plan_ms"]))

    def close(self) -> None:
        self.watch(False)
        self.page.close()
        self.session.close()
        self.server.stop()


def slowdown(place: Place, pairs: int = 5) -> None:
    """Alternating, so that a machine that warms up slows both."""
    place.flight()
    ratios = []
    for _ in range(pairs):
        times = []
        for on in (False, True):
            place.watch(on)
            times.append(place.flight())
        ratios.append(times[1] / times[0])
        print(
            f"plan {times[0]:.2f} ms alone, {times[1]:.2f} ms with {CLIENTS} clients: {100 * ratios[-1] - 100:+.1f} %"
        )
    median = 100 * float(np.median(ratios)) - 100
    print(
        f"median {median:+.1f} %, {'as claimed' if median < 10 else 'MORE than the 10 % claimed'}"
    )


def air(place: Place) -> None:
    began = time.perf_counter()
    place.session.tell(Race.start, [Choices()])
    while (
        not place.session.snapshot.competitors or len(place.session.snapshot.competitors[0].t) < 2
    ):
        time.sleep(0.001)
    seconds = time.perf_counter() - began
    print(
        f"click to air {seconds:.2f} s, {'as claimed' if seconds < 5 else 'MORE than the 5 s claimed'}"
    )


def soak(place: Place, minutes: float) -> None:
    place.watch(True)
    place.flight(3, SOAK_SAMPLES)
    first, end = None, time.monotonic() + 60 * minutes
    while time.monotonic() < end:
        place.flight(3, SOAK_SAMPLES)
        now = (resident(), threading.active_count())
        first = first or now
        print(f"{now[0]:.0f} MB, {now[1]} threads")
    print(
        f"grown by {now[0] - first[0]:+.0f} MB and {now[1] - first[1]:+d} threads in {minutes:g} minutes"
    )


def resident() -> float:
    """[MB]"""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


async def watchers(port: int) -> None:
    async def one() -> None:
        async with connect(port) as client:
            while True:
                await client._socket.recv()

    await asyncio.gather(*(one() for _ in range(CLIENTS)))


def main() -> None:
    what, *more = sys.argv[1:] or ["slowdown"]
    if what == "watch":
        asyncio.run(watchers(int(more[0])))
        return
    with tempfile.TemporaryDirectory() as root:
        place = Place(root)
        try:
            {
                "slowdown": slowdown,
                "air": air,
                "soak": lambda p: soak(p, float(more[0] if more else 30)),
            }[what](place)
        finally:
            place.close()


if __name__ == "__main__":
    main()
