"""Memory that races leave behind goes back to the operating system."""

from __future__ import annotations

import ctypes


def give_back() -> None:
    """Return free memory of the C library's heap to the operating system.

    A race allocates and frees many arrays. glibc keeps what is free between those that are still
    in use, and a page that flies races for hours would grow by it. C libraries without
    `malloc_trim` (macOS, Windows, musl) return memory by themselves, or not at all.
    """
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (OSError, TypeError, AttributeError):
        return
    trim(0)
