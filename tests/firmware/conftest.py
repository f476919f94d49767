"""The firmware that these tests need, where `race firmware build` has built it."""

import pytest

from quadsim.firmware import package
from quadsim.firmware.identified import identified
from quadsim.firmware.package import ADVICE, find_built


def pytest_collection_modifyitems(items):
    """Mark the tests that ask for the firmware: each flies behind a process of it."""
    for item in items:
        if "built" in getattr(item, "fixturenames", ()):
            for mark in ("firmware", "process", "compiled"):
                item.add_marker(mark)


@pytest.fixture(scope="session")
def built():
    """The built firmware; without it a test is skipped."""
    found = find_built()
    if found is None:
        pytest.skip(f"Betaflight is not built: {ADVICE}")
    return found


@pytest.fixture
def absent(monkeypatch):
    """Let a machine that has the firmware have none, as a new user's."""
    monkeypatch.setattr(package, "find_built", lambda: None)
    # Earlier tests of this process may have asked for it, and identified a vehicle behind it.
    package.built_firmware.cache_clear()
    identified.cache_clear()
