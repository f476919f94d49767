"""Operations for compiled functions that several threads run at once.

The atomic ones act on a whole number of 64 bits at an address. They are sequentially consistent:
every thread sees them in one order.
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
    """Return the type and the code of an operation that returns the number before it."""

    def generate(context, builder, signature, values):
        address, number = values
        return builder.atomic_rmw(operation, _pointer(builder, address), number, ORDER)

    return types.int64(types.int64, types.int64), generate


@extending.intrinsic
def add(typing_context, address, number):
    """Add to the number at an address, and return the number before."""
    return _changed("add")


@extending.intrinsic
def exchange(typing_context, address, number):
    """Set the number at an address, and return the number before."""
    return _changed("xchg")


@extending.intrinsic
def pause(typing_context):
    """Leave the core to its other hardware thread for a moment; does nothing but on x86."""

    def generate(context, builder, signature, values):
        if platform.machine() in X86:
            kind = ir.FunctionType(ir.VoidType(), [])
            builder.call(builder.module.declare_intrinsic("llvm.x86.sse2.pause", fnty=kind), [])
        return context.get_dummy_value()

    return types.void(), generate


@extending.intrinsic
def ticks(typing_context):
    """Return the processor's counter of time; 0 on processors that are no x86."""

    def generate(context, builder, signature, values):
        if platform.machine() not in X86:
            return NUMBER(0)
        kind = ir.FunctionType(NUMBER, [])
        counter = builder.module.declare_intrinsic("llvm.readcyclecounter", fnty=kind)
        return builder.call(counter, [])

    return types.int64(), generate
