"""The firmware that these tests need, where `race firmware build` has built it."""

import pytest

from quadsim.firmware.package import ADVICE, find_built


@pytest.fixture(scope="session")
def built():
    """The built firmware; without it a test is skipped."""
    found = find_built()
    if found is None:
        pytest.skip(f"Betaflight is not built: {ADVICE}")
    return found
