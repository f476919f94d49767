"""Operations for compiled functions that several threads run at once.

The atomic operations act on a 64-bit integer at an address. They are sequentially consistent:
all threads see them in the same order.
"""

from __future__ import annotations

import platform

from llvmlite import ir
from numba import extending, types

NUMBER = ir.IntType(64)
ALIGNMENT = 8  # bytes
ORDER = "seq_cst"
X86 = ("x86_64", "AMD64")  # names of such machines


def _pointer(builder, address):
    return builder.inttoptr(address, NUMBER.as_pointer())


@extending.intrinsic
def load(typing_context, address):
    """Return the number at an address."""

    def generate(context, builder, signature, values):
        return builder.load_atomic(_pointer(builder, values[0]), ORDER, ALIGNMENT)

    return types.int64(types.int64), generate


@extending.intrinsic
def store(typing_context, address, number):
    """Set the number at an address."""

    def generate(context, builder, signature, values):
        address, number = values
        builder.store_atomic(number, _pointer(builder, address), ORDER, ALIGNMENT)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), generate


def _changed(operation):
    """Return the type and the code of an atomic operation that returns the previous number."""

    def generate(context, builder, signature, values):
        address, number = values
        return builder.atomic_rmw(operation, _pointer(builder, address), number, ORDER)

    return types.int64(types.int64, types.int64), generate


@extending.intrinsic
def add(typing_context, address, number):
    """Add to the number at an address, and return the previous number."""
    return _changed("add")


@extending.intrinsic
def exchange(typing_context, address, number):
    """Set the number at an address, and return the previous number."""
    return _changed("xchg")


@extending.intrinsic
def pause(typing_context):
    """Yield the core to its other hardware thread for a moment, on x86 only."""

    def generate(context, builder, signature, values):
        if platform.machine() in X86:
            kind = ir.FunctionType(ir.VoidType(), [])
            builder.call(builder.module.declare_intrinsic("llvm.x86.sse2.pause", fnty=kind), [])
        return context.get_dummy_value()

    return types.void(), generate


@extending.intrinsic
def ticks(typing_context):
    """Return the processor's time stamp counter, 0 on processors other than x86."""

    def generate(context, builder, signature, values):
        if platform.machine() not in X86:
            return NUMBER(0)
        kind = ir.FunctionType(NUMBER, [])
        counter = builder.module.declare_intrinsic("llvm.readcyclecounter", fnty=kind)
        return builder.call(counter, [])

    return types.int64(), generate
