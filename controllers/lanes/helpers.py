"""Threads that help the calling thread with the blocks of a compiled loop.

The caller writes its job to a desk, an array that it shares with the helpers. The caller and every
awake helper take blocks from a counter on the desk until none is left. The caller waits only for
blocks that helpers have begun, and closes the job for all other helpers. A loop on several threads
therefore takes hardly longer than on one thread if other programs use the cores. The results do not
depend on which thread runs a block.

    caller                                      helper
    write the job, NEXT = 0, OPEN = ticket      wait until OPEN is a new ticket
    take blocks                                 WORKING += 1
    OPEN = 0                                    if OPEN is still that ticket: take blocks
    wait until WORKING is 0                     WORKING -= 1

All these operations are sequentially consistent. A helper that finds the job open is therefore
counted before the caller reads WORKING, and a later helper finds the job closed. The desk has room
for one job. If it has the job of another thread of the process, the caller runs its blocks alone.

A helper polls the desk for SPINS rounds, longer than the gap between two loops of a control step,
and then sleeps until a caller wakes it by its bell, a lock.

If another program takes a helper's core in the middle of a block, the caller waits for a time
slice, some milliseconds. A caller that has waited longer than a few portions of its own work
therefore does not wake the helpers for the next loops; the number of these loops doubles each time.

A polling helper keeps its core from other programs, so one of them may alternate with the caller
instead. Linux measures the time for which the caller waits for a core. If it exceeds the share
WAITED of the caller's running time, the caller does not wake the helpers, either.
"""

from __future__ import annotations

import atexit
import os
import threading
from _thread import LockType
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import extending, njit, types
from numba.core.compiler import CompileResult

from quadsim.controllers.lanes.atomics import add, exchange, load, pause, store, ticks
from quadsim.controllers.lanes.compiled import kept

ADDRESS = ir.IntType(64)

# Places of the numbers on a desk. Those that several threads write lie on cache lines of their own.
LINE = 64  # bytes
RUN = 0  # address of the compiled `run_parts`, which `sharing.share` calls
PART = 8  # address of the function that runs some blocks, see `sharing.share`
SHARED = 16  # address of its arguments
BLOCKS = 24  # number of blocks
STRIDE = 32  # number of blocks that are taken at a time
SEATS = 40  # number of helpers that may work at once
TICKET = 48  # number of the last job
REST = 56  # number of loops for which the helpers are left asleep
OPEN = LINE  # number of the job on the desk; 0: there is no job, or it is closed
NEXT = 2 * LINE  # the first block that nobody has taken
WORKING = 3 * LINE  # number of helpers that look at the job
TAKEN = 4 * LINE  # 1 while a caller uses the desk
PAUSES = TAKEN + 8  # number of loops of the last rest; 0: the last loop went well
SIZE = 5 * LINE  # bytes

SPINS = 20_000  # rounds in which a helper looks for the next job: about half a millisecond
PATIENCE = 2  # portions of its own work for which a caller may wait without a rest after it
REST_MIN, REST_MAX = 8, 1024  # numbers of loops of a rest
WATCHED = 64  # number of loops with helpers after which a caller looks at its waiting time
WAITED = 0.1  # waiting time over running time above which the helpers rest
SHARES = 8  # blocks are taken in about this many portions for each thread
# Of run_parts: address of the desk, of a part, of the shared data; number of blocks, threads
RUN_PARTS = (types.int64, types.int64, types.int64, types.int64)
HELP_CALLERS = (types.int64, types.int64)


@extending.intrinsic
def call_part(typing_context, part, shared, first, last):
    """Call a part, see `sharing.share`, for the blocks from `first` to before `last`."""

    def generate(context, builder, signature, values):
        part, *rest = values
        kind = ir.FunctionType(ir.VoidType(), [ADDRESS] * len(rest))
        builder.call(builder.inttoptr(part, kind.as_pointer()), rest)
        return context.get_dummy_value()

    return types.void(part, shared, first, last), generate


@njit(nogil=True)
def take_blocks(desk):
    """Run blocks of the job on the desk until all are taken, and return the number of portions."""
    part = load(desk + PART)  # pyright: ignore[reportCallIssue]
    shared = load(desk + SHARED)
    blocks = load(desk + BLOCKS)
    stride = load(desk + STRIDE)
    portions = 0
    while True:
        first = add(desk + NEXT, stride)
        if first >= blocks:
            return portions
        portions += 1
        call_part(part, shared, first, min(first + stride, blocks))


@kept
@njit(nogil=True)
def run_parts(desk, part, shared, blocks):
    """Run a part for all blocks, with the helpers that are awake.

    Args:
        desk: address of the desk.
        part: address of the part, see `sharing.share`.
        shared: address of the data that the parts share.
        blocks: number of blocks.
    """
    threads = load(desk + SEATS) + 1  # pyright: ignore[reportCallIssue]
    stride = max(blocks // (threads * SHARES), 1)
    if blocks <= stride or exchange(desk + TAKEN, 1) == 1:
        call_part(part, shared, 0, blocks)
        return
    store(desk + PART, part)
    store(desk + SHARED, shared)
    store(desk + BLOCKS, blocks)
    store(desk + STRIDE, stride)
    store(desk + NEXT, 0)
    store(desk + OPEN, add(desk + TICKET, 1) + 1)
    begin = ticks()
    portions = take_blocks(desk)
    store(desk + OPEN, 0)
    end = ticks()
    while load(desk + WORKING) > 0:
        pause()
    waited = ticks() - end

    # Leave the helpers asleep if another program keeps them from their cores.
    rest = 0
    if waited > PATIENCE * (end - begin) // max(portions, 1):
        rest = min(max(2 * load(desk + PAUSES), REST_MIN), REST_MAX)
    store(desk + PAUSES, rest)
    store(desk + REST, rest)
    store(desk + TAKEN, 0)


@kept
@njit(nogil=True)
def help_callers(desk, spins):
    """Help with the jobs on a desk until there has been none for a number of rounds."""
    last = 0  # the job that this helper has worked on
    left = spins
    while left > 0:
        ticket = load(desk + OPEN)  # pyright: ignore[reportCallIssue]
        if ticket in (0, last):
            left -= 1
            pause()
            continue
        place = add(desk + WORKING, 1)
        if load(desk + OPEN) == ticket and place < load(desk + SEATS):
            take_blocks(desk)
        add(desk + WORKING, -1)
        last = ticket
        left = spins


class Helper(NamedTuple):
    """A helping thread, and the lock by which a caller wakes it."""

    thread: threading.Thread
    bell: LockType  # locked until a caller rings


class OnCore(NamedTuple):
    """The time for which a thread has run, and for which it has waited for a core."""

    thread: int
    ran: int  # [ns]
    waited: int  # [ns]

    @classmethod
    def of_this_thread(cls) -> OnCore:
        """Return the times of the calling thread, zeros if the system does not count them."""
        thread = threading.get_ident()
        try:
            with open("/proc/thread-self/schedstat", "rb") as file:
                ran, waited, _ = file.read().split()
        except (OSError, ValueError):
            return cls(thread, 0, 0)
        return cls(thread, int(ran), int(waited))


class Helpers:
    """The helping threads of a process, and their desk."""

    def __init__(self) -> None:
        # Align the start of the desk to a cache line.
        self._memory = np.zeros(SIZE + LINE, np.uint8)
        offset = -self._memory.ctypes.data % LINE
        self._desk = self._memory.ctypes.data + offset
        self._numbers = self._memory[offset : offset + SIZE].view(np.int64)
        self._numbers[RUN // 8] = _address(_compiled(run_parts, RUN_PARTS))
        self._help = _compiled(help_callers, HELP_CALLERS).entry_point
        self._helpers: list[Helper] = []
        self._starts = threading.Lock()
        self._ends = False
        self._watched = 0  # loops with helpers since a caller has looked at its times
        self._rest = 0  # number of loops of the last rest, halved by each look without one
        self._on_core = OnCore(0, 0, 0)
        atexit.register(self._end)

    def wake(self, number: int) -> int:
        """Wake some helpers for the next loop, and return the address of their desk.

        Returns:
            The address of the desk, 0 if the caller is to run the loop alone.
        """
        if self._numbers[REST // 8] > 0:
            self._numbers[REST // 8] -= 1
            return 0
        self._watched += 1
        if self._watched >= WATCHED and self._rests_now():
            return 0
        if len(self._helpers) < number:
            self._start(number)
        self._numbers[SEATS // 8] = number
        for helper in self._helpers[:number]:
            ring(helper.bell)
        return self._desk

    def _rests_now(self) -> bool:
        """Return whether another program alternated with the caller, so that the helpers rest."""
        self._watched = 0
        before = self._on_core
        self._on_core = now = OnCore.of_this_thread()
        waited = now.waited - before.waited
        if now.thread != before.thread or waited <= WAITED * (now.ran - before.ran):
            self._rest //= 2
            return False
        self._rest = min(max(2 * self._rest, WATCHED), REST_MAX)
        self._numbers[REST // 8] = self._rest
        return True

    def _start(self, number: int) -> None:
        """Start helpers until there are `number`."""
        with self._starts:
            while len(self._helpers) < number:
                bell = threading.Lock()
                bell.acquire()
                name = f"lanes_{len(self._helpers) + 1}"
                thread = threading.Thread(target=self._serve, args=(bell,), name=name, daemon=True)
                thread.start()
                self._helpers.append(Helper(thread, bell))

    def _serve(self, bell: LockType) -> None:
        """Help, or sleep while there is nothing to do, until the process ends."""
        while True:
            bell.acquire()
            if self._ends:
                return
            self._help(self._desk, SPINS)

    def _end(self) -> None:
        """End the helpers before the compiled code that they run is unloaded."""
        self._ends = True
        for helper in self._helpers:
            ring(helper.bell)
            helper.thread.join(timeout=1.0)


def ring(bell: LockType) -> None:
    """Wake a helper by unlocking its bell, which may be unlocked already."""
    if bell.locked():
        with suppress(RuntimeError):  # another caller has rung it in this moment
            bell.release()


_helpers: Helpers | None = None


def helpers() -> Helpers:
    """Return the helping threads of this process."""
    global _helpers
    if _helpers is None:
        _helpers = Helpers()
    return _helpers


def _forget() -> None:
    """Forget the parent's threads in a forked process, which starts its own."""
    global _helpers
    _helpers = None


if hasattr(os, "register_at_fork"):  # platforms with fork
    os.register_at_fork(after_in_child=_forget)


def _compiled(function: Any, signature: tuple[types.Type, ...]) -> CompileResult:
    """Return the code of a compiled function, which numba keeps."""
    function.compile(signature)
    return function.overloads[signature]


def _address(code: CompileResult) -> int:
    """Return the address of compiled code."""
    return code.library.get_pointer_to_function(code.fndesc.llvm_func_name)
