"""Every run names the commit that flew it."""

import subprocess
from pathlib import Path

import pytest

from quadsim.record.provenance import git_commit

ROOT = Path(__file__).parents[2]


@pytest.mark.process
@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a checkout")
def test_a_checkout_names_its_commit():
    head = subprocess.run(
        ["git", "-C", str(ROOT), "rev-parse", "HEAD"], capture_output=True, text=True, check=True
    )
    # The function itself: of the commit that it was asked for first, the tests are told again.
    commit = git_commit.__wrapped__()
    assert (commit or "none").removesuffix("-dirty") == head.stdout.strip()
