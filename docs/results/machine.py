"""Whether a machine computes flights with the digits that the documentation has."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path


def has_documented_digits() -> bool:
    """Return whether flights have the digits of the pages: AVX-512, and PyBullet."""
    flags = Path("/proc/cpuinfo").read_text()
    return "avx512f" in flags and find_spec("pybullet") is not None
