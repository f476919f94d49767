"""Measure the cost of a page. This is no test: it takes minutes and a quiet machine to itself.

python tests/web/measure.py slowdown   plan time with three clients against none: < 10 % more
python tests/web/measure.py air        from one click to the second frame: < 5 s
python tests/web/measure.py four       real-time factor of a race of four, without and with a page,
                                       here and where one step of the whole budget takes 10 ms
python tests/web/measure.py share      share of a core and kB/s of the page for 0, 1 and 3 visitors:
                                       at rest, with two that fly without a planner, and the same
                                       with `Send less`
python tests/web/measure.py page       `share`, and in a chromium without a window the first paint,
                                       the time until START can be pressed, and that from START to
                                       the first motion: five minutes at most
python tests/web/measure.py soak 60    memory and threads over an hour of races of four: < 20 MB
                                       more after the first ten minutes
python tests/web/measure.py soak 60 small   the same with the small planner of the tests, at a fifth
                                       of real time, which takes about a fifth of a core
python tests/web/measure.py soak 60 glide   the same with short flights without a planner

The clients of `slowdown` have a core to themselves, so that what they take is the page's own work.
That of `four` shares the cores, as a browser does; it draws nothing.
"""

from __future__ import annotations

import asyncio
import json
import os
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import websockets
from playwright.sync_api import Page, ViewportSize, sync_playwright
from websockets.asyncio.client import ClientConnection

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2]))

from web_cases import Gliders
from wire import CAMERA, PROTOCOL

from quadsim.bench.cases import QUADROTOR, median_ms, paper_case, starting
from quadsim.web.page.dashboard import Dashboard
from quadsim.web.page.server.page_server import serve
from quadsim.web.race.page_race import PageRace, TakeOff, take_off
from quadsim.web.race.session import Session
from quadsim.web.state.choices import Choices, HeatChoices
from quadsim.web.state.commands import SetView
from quadsim.web.state.menu import Menu
from tests.small import SMALL

CLIENTS = 3
PAGE_CORE, CLIENT_CORE = 0, 1
SOAK_PLANNER = {"samples": 512}  # few: the page may grow, not the planner
SMALL_SPEED = 0.2  # race seconds per second of a soak with the small planner
SOAK_SAMPLERS = ("colored", "gaussian", "colored", "gaussian")  # in one world
WARM_UP = 600.0  # [s] until a soak counts
FOUR_SAMPLES = 1024
FOUR_BEGIN = 0.5  # race time from which the race of four is measured [s]
FOUR_SPAN = 15.0  # wall-clock time for which it is measured [s]
MEASURES = ("slowdown", "air", "four", "share", "page", "soak")
LOADS = 5  # of the page, of which medians are taken
STARTS = 5
SCENE_DRAWN = 2500.0  # [ms] by which the scene is drawn
# What a page says of itself: the first paint, and when START could be pressed [ms]
PAINTED = """() => new Promise(done => {
    const look = () => {
        const [painted] = performance.getEntriesByName("first-contentful-paint");
        const isReady = Boolean(document.querySelector(".head .sentence")?.textContent);
        if (painted && isReady) done([painted.startTime, performance.now()]);
        else setTimeout(look, 5);
    };
    look(); })"""
# Press START, and say when the time of the race moves [ms]
MOVED = """() => new Promise(done => {
    const before = performance.now();
    const shown = () => document.querySelector(".head .state").textContent;
    document.querySelector("[data-act=start]").click();
    const look = () => {
        const t = Number(shown().match(/t ([\\d.]+) s/)?.[1] ?? 0);
        if (t > 0 && t < 5) done(performance.now() - before);
        else setTimeout(look, 5);
    };
    setTimeout(look, 50); })"""
MOST_SLOWER = 10.0  # [%]
MOST_SECONDS = 5.0
MOST_GROWN = 20.0  # [MB]
SHARE_SPAN = 10.0  # [s] over which a share is measured
SHARE_VISITORS = (0, 1, 3)
WINDOW = ViewportSize(width=1280, height=800)
# Chromium without a graphics card
SOFTWARE = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
# what a page asks for with the tab Laps open
ASK = {"type": "ask", "have": {}, "shows": ["laps"]}
MENU = Menu(("split_s_swift",), ("swift",), ("race",), ("colored", "gaussian"))


class Place:
    """A page on a session, and clients of it in a process of their own."""

    def __init__(self, root: str, take_off: TakeOff = take_off):
        self.server = serve("127.0.0.1", 0, None, "race")
        self.session = Session(root, take_off)
        self.page = Dashboard(self.server, self.session, MENU, Choices())
        self._watchers: subprocess.Popen | None = None

    def watch(self, clients: int, core: int | None = None) -> None:
        """Open some connections in place of those before, on one core or on all."""
        if self._watchers:
            self._watchers.kill()
            self._watchers.communicate()  # waits, and closes its pipe
            self._watchers = None
        if clients:
            command = [sys.executable, __file__, "watch", str(self.server.get_port()), str(clients)]
            command += [] if core is None else [str(core)]
            self._watchers = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        while len(self.server.get_clients()) != clients:
            time.sleep(0.05)

    def received(self) -> float:
        """Return what the connections have received since the last call [kB]."""
        if self._watchers is None or self._watchers.stdout is None:
            return 0.0
        self._watchers.send_signal(signal.SIGUSR1)
        return float(self._watchers.stdout.readline()) / 1e3

    def flight(self) -> float:
        """Fly one lap. Return the median plan time in real time [ms]."""
        self._fly(Choices(laps=1))
        return float(np.median(self.session.snapshot.competitors[0].x["plan_ms"]))

    def heat(self, seed: int, settings: dict[str, int]) -> str:
        """Race four drones in one world. Return how it ended for each of them."""
        entrants = [Choices(sampler=name, seed=seed, settings=settings) for name in SOAK_SAMPLERS]
        self._fly(HeatChoices(tuple(entrants)))
        return ", ".join(one.outcome or "" for one in self.session.snapshot.competitors)

    def ghosts(self, seed: int) -> str:
        """Fly four side by side without a planner. Return how it ended for each of them."""
        flights = [Choices(sampler=name, seed=seed, laps=2) for name in SOAK_SAMPLERS]
        self._fly(*flights)
        return ", ".join(one.outcome or "" for one in self.session.snapshot.competitors)

    def four(self) -> float:
        """Race four drones in one world for a while. Return the real-time factor."""
        entrants = [Choices(settings={"samples": FOUR_SAMPLES}) for _ in range(4)]
        races = self.session.snapshot.race
        self.session.tell(PageRace.start, [HeatChoices(tuple(entrants))])
        while self.session.snapshot.race == races or self.session.snapshot.t < FOUR_BEGIN:
            time.sleep(0.05)
        first, began = self.session.snapshot.t, time.perf_counter()
        time.sleep(FOUR_SPAN)
        last, ended = self.session.snapshot.t, time.perf_counter()
        if not self.session.snapshot.flying:
            raise RuntimeError("four: expected a race that is still on, got one that has ended")
        self.session.tell(PageRace.end_flights)
        while self.session.snapshot.flying:
            time.sleep(0.05)
        return (last - first) / (ended - began)

    def _fly(self, *choices: Choices | HeatChoices) -> None:
        """Fly to the end."""
        races = self.session.snapshot.race
        self.session.tell(PageRace.start, list(choices))
        while self.session.snapshot.race == races or self.session.snapshot.flying:
            time.sleep(0.05)

    def close(self) -> None:
        """End everything."""
        self.watch(0)
        self.page.close()
        self.session.close()
        self.server.stop()


def slowdown(place: Place, pairs: int = 5) -> None:
    """Compare plan times, in turns, so that a machine that warms up slows both."""
    pin_threads(PAGE_CORE)
    place.flight()
    slower = []
    for _ in range(pairs):
        place.watch(0)
        alone = place.flight()
        place.watch(CLIENTS, CLIENT_CORE)
        watched = place.flight()
        slower.append(100 * watched / alone - 100)
        times = f"plan {alone:.2f} ms alone, {watched:.2f} ms with {CLIENTS} clients"
        print(f"{times}: {slower[-1]:+.1f} %")
    median = float(np.median(slower))
    print(f"median {median:+.1f} %, {verdict(median, MOST_SLOWER, '%')}")


def air(place: Place) -> None:
    """Measure how long it takes from a click to the second frame."""
    began = time.perf_counter()
    place.session.tell(PageRace.start, [Choices()])
    while True:
        competitors = place.session.snapshot.competitors
        if competitors and len(competitors[0].t) >= 2:
            break
        time.sleep(0.001)
    seconds = time.perf_counter() - began
    print(f"click to air {seconds:.2f} s, {verdict(seconds, MOST_SECONDS, 's')}")


def four(place: Place, pairs: int = 2) -> None:
    """Compare a race of four with what the machine needs for one step of the whole budget."""
    whole = starting(paper_case(QUADROTOR, "colored"))
    for _ in range(pairs):
        step_ms = median_ms(lambda: whole.mppi.control(whole.x), 3.0)
        place.watch(0)
        alone = place.four()
        place.watch(1)
        watched = place.four()
        period_ms = 1e3 * whole.mppi.config.dt
        print(f"a step of the whole budget takes {step_ms:.1f} ms")
        for what, factor in (("without a page", alone), ("with a page", watched)):
            there = factor * step_ms / period_ms
            print(
                f"four {what}: {factor:.2f} of real time, {there:.2f} if it took {period_ms:g} ms"
            )


def share(place: Place) -> None:
    """Measure the share of a core that the page takes, and what it sends."""
    print("visitors  at rest       racing        racing, sending less")
    for visitors in SHARE_VISITORS:
        place.watch(visitors)
        time.sleep(2.0)
        found = [_share_now(place, max(visitors, 1))]
        for light in (False, True):
            for one in place.page.desk.state.visitors:
                place.page.desk.do(SetView(one, "light", light))
            races = place.session.snapshot.race
            flights = [Choices(sampler=name, laps=1000) for name in ("colored", "gaussian")]
            place.session.tell(PageRace.start, flights)
            while place.session.snapshot.race == races or place.session.snapshot.t < 2.0:
                time.sleep(0.05)
            found.append(_share_now(place, max(visitors, 1)))
            place.session.tell(PageRace.end_flights)
            while place.session.snapshot.flying:
                time.sleep(0.05)
        for one in place.page.desk.state.visitors:
            place.page.desk.do(SetView(one, "light", False))
        print(f"{visitors:8}  {'  '.join(found)}", flush=True)


def browse(place: Place, measured: Callable[[Page], list[float]], times: int) -> list[float]:
    """Return the medians of what is measured in pages that are opened one after the other."""
    found = []
    with sync_playwright() as p:
        chromium = shutil.which("chromium") or shutil.which("chromium-browser")
        browser = p.chromium.launch(executable_path=chromium, args=SOFTWARE)
        for _ in range(times):
            with browser.new_context(viewport=WINDOW) as context:
                page = context.new_page()
                page.goto(f"http://127.0.0.1:{place.server.get_port()}/")
                found.append(measured(page))
        browser.close()
    return np.median(found, axis=0).tolist()


def paint(place: Place) -> None:
    """Measure how long a page takes to be seen, and until START can be pressed."""
    painted, ready = browse(place, lambda page: page.evaluate(PAINTED), LOADS)
    print(f"first paint {painted / 1e3:.2f} s, START can be pressed after {ready / 1e3:.2f} s")


def motion(place: Place) -> None:
    """Measure how long it takes from START in a browser until the race is seen to move.

    The browser loads and draws the scene for a second after START can be pressed, so that a START
    at once takes longer.
    """

    def started(page: Page) -> float:
        moved = float(page.evaluate(MOVED))
        place.session.tell(PageRace.end_flights)
        while place.session.snapshot.flying:
            time.sleep(0.05)
        return moved

    def measured(page: Page) -> list[float]:
        page.evaluate(PAINTED)
        at_once = started(page)
        page.wait_for_timeout(SCENE_DRAWN)
        return [at_once, started(page)]

    place.flight()  # compiles what is not yet compiled
    at_once, later = browse(place, measured, STARTS)
    print(f"from START to the first motion on the page {later / 1e3:.2f} s, with the scene drawn;")
    print(f"of a START as soon as it can be pressed {at_once / 1e3:.2f} s")


def _share_now(place: Place, visitors: int) -> str:
    """Return the share of a core [%] and what each visitor is sent [kB/s], as text."""
    place.received()
    began = time.perf_counter()
    spent = time.process_time()
    time.sleep(SHARE_SPAN)
    seconds = time.perf_counter() - began
    percent = 100 * (time.process_time() - spent) / seconds
    return f"{percent:5.1f} % {place.received() / seconds / visitors:5.0f} kB/s"


def verdict(found: float, most: float, unit: str) -> str:
    """Return whether a claim holds."""
    return "as claimed" if found < most else f"MORE than the {most:g} {unit} claimed"


def soak(place: Place, minutes: float, is_small: bool, glides: bool) -> None:
    """Measure memory and threads over many races of four."""
    place.watch(CLIENTS, CLIENT_CORE)
    settings = SMALL if is_small else SOAK_PLANNER
    if is_small:
        place.session.tell(PageRace.set_speed, SMALL_SPEED)
    memory: list[float] = []  # [MB], from WARM_UP on
    began = time.monotonic()
    spent = time.process_time()
    races = 0
    while time.monotonic() - began < 60 * minutes:
        outcomes = place.ghosts(races) if glides else place.heat(races, settings)
        races += 1
        now = resident()
        passed = time.monotonic() - began
        if passed >= WARM_UP:
            memory.append(now)
        minute = f"{passed / 60:5.1f} min"
        share = 100 * (time.process_time() - spent) / passed
        found = f"{now:.0f} MB  {threading.active_count()} threads  {share:.0f} % of a core"
        print(f"{minute}  {found}  {outcomes}", flush=True)
    if memory:
        most = max(memory) - memory[0]
        print(f"{races} races in {minutes:g} minutes; after the first {WARM_UP / 60:g} minutes")
        print(f"{memory[0]:.0f} to {memory[-1]:.0f} MB: at most {most:+.1f} MB", end=", ")
        print(verdict(most, MOST_GROWN, "MB"))


def pin_threads(core: int) -> None:
    """Keep all threads of this process, those that it will start too, on one core."""
    for thread in Path("/proc/self/task").iterdir():
        os.sched_setaffinity(int(thread.name), {core})


def resident() -> float:
    """Return the memory of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


async def watchers(port: int, clients: int) -> None:
    """Watch a page by some connections, and print the bytes received when a signal asks."""
    received = 0

    class Counted(ClientConnection):
        """A connection that counts what the network brings, compressed as it is."""

        def data_received(self, data: bytes) -> None:
            nonlocal received
            received += len(data)
            super().data_received(data)

    def tell() -> None:
        nonlocal received
        print(received, flush=True)
        received = 0

    async def scene(seat: str) -> None:
        address = f"ws://127.0.0.1:{port}/scene/{seat}"
        async with websockets.connect(
            address,
            create_connection=Counted,
            subprotocols=[PROTOCOL],
            max_size=None,
            ping_interval=None,
        ) as socket:
            await socket.send(msgspec.msgpack.encode(CAMERA))
            while True:
                await socket.recv()

    async def page(seat: str) -> None:
        have: dict[str, int] = {}
        link = f"ws://127.0.0.1:{port}/link"
        async with websockets.connect(
            link, create_connection=Counted, max_size=None, ping_interval=None
        ) as socket:
            while True:
                await socket.send(json.dumps({**ASK, "have": have, "seat": seat}))
                answer: dict = {}
                while answer.get("type") != "parts":
                    answer = json.loads(await socket.recv())
                have |= {name: part["version"] for name, part in answer["parts"].items()}

    asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, tell)
    seats = [secrets.token_urlsafe(18) for _ in range(clients)]
    await asyncio.gather(*(one(seat) for seat in seats for one in (scene, page)))


def main() -> None:
    what, *more = sys.argv[1:] or ["slowdown"]
    if what == "watch":
        port, clients, *core = map(int, more)
        if core:
            os.sched_setaffinity(0, core)
        asyncio.run(watchers(port, clients))
        return
    if what not in MEASURES:
        sys.exit(f"measure.py: expected one of {', '.join(MEASURES)}, got {what!r}")
    with tempfile.TemporaryDirectory() as root:
        if what == "page":
            place = Place(root, Gliders())
            share(place)
            place.watch(0)
            paint(place)
            place.close()
            what = "motion"
        glides = what == "share" or "glide" in more
        place = Place(root, Gliders()) if glides else Place(root)
        try:
            if what == "slowdown":
                slowdown(place)
            elif what == "air":
                air(place)
            elif what == "four":
                four(place)
            elif what == "share":
                share(place)
            elif what == "motion":
                motion(place)
            elif what == "soak":
                soak(place, float(more[0]) if more else 30.0, "small" in more, "glide" in more)
        finally:
            place.close()


if __name__ == "__main__":
    main()
