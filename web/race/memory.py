"""Return memory that races have freed to the operating system."""

from __future__ import annotations

import ctypes


def give_back() -> None:
    """Return free memory of the C library's heap to the operating system.

    A race allocates and frees many arrays. glibc keeps free memory between arrays in use, so a page
    that flies races for hours would grow. C libraries without `malloc_trim` (macOS, Windows, musl)
    return memory by themselves, or not at all.
    """
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (OSError, TypeError, AttributeError):
        return
    trim(0)
