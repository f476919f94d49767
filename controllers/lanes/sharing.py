"""Run loops over blocks on several threads, although their text is compiled only once.

Such a loop is a plain function that runs the blocks from `first` to before `last`:

    @kept
    @njit(nogil=True)
    def scaled(desk, first, last, x, factor):
        if desk:
            share(desk, last)
            return
        for b in range(first, last):
            ...

    on_threads(scaled, len(x), x, factor)

`share` passes the function and its arguments to `helpers.run_parts`, which calls the function again
on several threads, with some of the blocks and zero as `desk`. A call from Python with zero as
`desk` runs only on the calling thread. numba's own parallel loops would be compiled twice and
linked three times, and would wait for threads that are not running.

The parts get the function and its arguments by address. This is safe because `share` returns only
after all parts have returned, and until then the caller keeps the arguments. No block may depend on
another one, because their order is not fixed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import extending, types
from numba.core import cgutils
from numba.core.callconv import RETCODE_OK

from quadsim.controllers.lanes.helpers import RUN_PARTS, helpers
from quadsim.controllers.lanes.threads import threads

ADDRESS = ir.IntType(64)
FLAG = ir.IntType(8)
OWN = 3  # arguments of a loop that each part has for itself: desk, first, last
NO_MEMORY = "no memory is left for a loop on several threads"


@extending.intrinsic
def share(typing_context, desk, blocks):
    """Run the calling function for all blocks on several threads.

    The first arguments of the calling function are the 64-bit integers `desk`, `first` and `last`.
    It has no result, and raises an error only if memory runs out.

    Args:
        desk: address of the desk, see quadsim.controllers.lanes.helpers.
        blocks: number of blocks.
    """

    def generate(context, builder, signature, values):
        desk, blocks = values
        loop = builder.function
        result, error, *arguments = loop.args
        arguments = arguments[OWN:]

        # Store the data that the parts share: whether one of them has failed, and the arguments.
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

        # Call `helpers.run_parts`, another function of numba, whose address is the desk's first
        # number.
        kind = context.call_conv.get_function_type(types.none, RUN_PARTS)
        address_of_run = builder.load(builder.inttoptr(desk, ADDRESS.as_pointer()))
        run = builder.inttoptr(address_of_run, kind.as_pointer())
        numbers = [desk, builder.ptrtoint(part, ADDRESS), builder.ptrtoint(shared, ADDRESS), blocks]
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
        loop: compiled function of (desk, first, last, *arguments).
        blocks: number of blocks.
        arguments: further arguments of the loop.

    Raises:
        MemoryError: there is no memory for arrays that the loop makes.
    """
    wanted = min(threads(), blocks) - 1
    desk = helpers().wake(wanted) if wanted > 0 else 0
    loop(desk, 0, blocks, *arguments)
