"""Claims about the logic of the page's scripts, which Node's own test runner checks."""

import shutil
import subprocess
from pathlib import Path

import pytest

TESTS = Path(__file__).with_name("shell")
NODE = shutil.which("node")


@pytest.mark.process
@pytest.mark.skipif(NODE is None, reason="needs Node.js 20 or newer on the PATH")
def test_the_claims_of_the_scripts_hold():
    files = sorted(map(str, TESTS.glob("*.test.js")))
    ended = subprocess.run([NODE, "--test", *files], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0, ended.stdout
