"""Loops over blocks that run on several threads, and whose text is compiled once.

numba compiles the body of a `prange` twice, as a part of the function and as a kernel, and links it
three times, which takes most of the time that a long loop takes to compile. So a long loop is a
plain function instead, which runs the blocks from `first` to before `last`:

    @kept
    @njit(nogil=True)
    def scaled(run_parts, first, last, x, factor):
        if run_parts:
            share(run_parts, last)
            return
        for b in range(first, last):
            ...

    on_threads(scaled, len(x), x, factor)

`share` hands the function itself and its arguments to `run_parts`, the one loop that is parallel.
`run_parts` calls the function again on each thread, with a part of the blocks and with zero in the
place of `run_parts`. A call from Python with zero in that place runs on the calling thread alone.

The parts know the function and its arguments by address only, which is safe because `share` returns
when all parts have: until then the caller holds the arguments. No block may depend on another one,
as the order in which they run differs.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from llvmlite import ir
from numba import extending, njit, prange, types
from numba.core import cgutils
from numba.core.callconv import RETCODE_OK

# numba.get_num_threads as numba's own parallel loops call it: compiled code that calls the public
# function holds an address of this process, and so cannot be kept on the disk.
from numba.np.ufunc.parallel import _iget_num_threads

from controllers.lanes.compiled import kept, lost_threads

ADDRESS = ir.IntType(64)
FLAG = ir.IntType(8)
OWN = 3  # arguments of a loop that each part has for itself: run_parts, first, last
# The address of a part, the address of what it shares with the others, the number of blocks
RUN_PARTS = (types.int64, types.int64, types.int64)
NO_MEMORY = "no memory is left for a loop on several threads"


@extending.intrinsic
def _call(typing_context, part, shared, first, last):
    """Call a part, see `share`, for the blocks from `first` to before `last`."""

    def generate(context, builder, signature, values):
        part, *rest = values
        kind = ir.FunctionType(ir.VoidType(), [ADDRESS] * len(rest))
        builder.call(builder.inttoptr(part, kind.as_pointer()), rest)
        return context.get_dummy_value()

    return types.void(part, shared, first, last), generate


@kept
@njit(parallel=True, nogil=True)
def run_parts(part, shared, blocks):
    """Run a part for some of the blocks on each thread.

    Args:
        part: address of the part, see `share`.
        shared: address of what the parts share.
        blocks: number of blocks.
    """
    threads = _iget_num_threads()  # pyright: ignore[reportCallIssue]
    parts = min(threads, blocks)
    for k in prange(parts):
        first = k * blocks // parts
        last = (k + 1) * blocks // parts
        _call(part, shared, first, last)  # pyright: ignore[reportCallIssue]


@extending.intrinsic
def share(typing_context, run_parts, blocks):
    """Run the function that calls this on several threads, for all blocks.

    The first arguments of that function are `run_parts`, `first` and `last`, of 64 bits each. It
    returns nothing, and raises nothing unless memory runs out.

    Args:
        run_parts: address of the compiled `run_parts`.
        blocks: number of blocks.
    """

    def generate(context, builder, signature, values):
        run_parts, blocks = values
        loop = builder.function
        result, error, *arguments = loop.args
        arguments = arguments[OWN:]

        # Store what the parts share: whether one of them has failed, and the arguments.
        record = ir.LiteralStructType([FLAG, *(argument.type for argument in arguments)])
        shared = cgutils.alloca_once(builder, record)
        builder.store(FLAG(0), cgutils.gep_inbounds(builder, shared, 0, 0))
        for k, argument in enumerate(arguments, 1):
            builder.store(argument, cgutils.gep_inbounds(builder, shared, 0, k))

        # Write a function beside the loop that loads the arguments and calls the loop with them.
        kind = ir.FunctionType(ir.VoidType(), [ADDRESS] * 3)
        part = ir.Function(builder.module, kind, f"{loop.name}.part")
        part.linkage = "internal"
        inside = ir.IRBuilder(part.append_basic_block())
        address, first, last = part.args
        found = inside.inttoptr(address, record.as_pointer())
        loaded = [
            inside.load(cgutils.gep_inbounds(inside, found, 0, k))
            for k in range(1, len(arguments) + 1)
        ]
        # numba's functions write results and errors to places that they are given.
        places = [inside.alloca(place.type.pointee) for place in (result, error)]
        code = inside.call(loop, [*places, ADDRESS(0), first, last, *loaded])
        with inside.if_then(inside.icmp_signed("!=", code, RETCODE_OK)):
            inside.store(FLAG(1), cgutils.gep_inbounds(inside, found, 0, 0))
        inside.ret_void()

        # Call `run_parts`, another function of numba.
        kind = context.call_conv.get_function_type(types.none, RUN_PARTS)
        run = builder.inttoptr(run_parts, kind.as_pointer())
        numbers = [builder.ptrtoint(part, ADDRESS), builder.ptrtoint(shared, ADDRESS), blocks]
        status, _ = context.call_conv.call_function(builder, run, types.none, RUN_PARTS, numbers)

        # An error in another thread would be lost, so that the caller would take what is in its
        # arrays for the result.
        part_failed = builder.trunc(
            builder.load(cgutils.gep_inbounds(builder, shared, 0, 0)), ir.IntType(1)
        )
        with cgutils.if_unlikely(builder, builder.or_(status.is_error, part_failed)):
            context.call_conv.return_user_exc(builder, MemoryError, (NO_MEMORY,))
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), generate


def on_threads(loop: Callable, blocks: int, *arguments: Any) -> None:
    """Run a loop that shares its blocks on the threads in use.

    Args:
        loop: the compiled function of (run_parts, first, last, *arguments).
        blocks: number of blocks.
        arguments: its further arguments.

    Raises:
        MemoryError: the loop makes arrays, for which no memory is left.
    """
    loop(_address(lost_threads()), 0, blocks, *arguments)


# Compiled code of run_parts that addresses point to
_held: list[Any] = []


@cache
def _address(one_thread: bool) -> int:
    """Return the address of the compiled `run_parts`.

    Args:
        one_thread: whether this process has lost its threads, for which other code is compiled.
    """
    run_parts.compile(RUN_PARTS)
    code = run_parts.overloads[RUN_PARTS]
    _held.append(code)
    return code.library.get_pointer_to_function(code.fndesc.llvm_func_name)
