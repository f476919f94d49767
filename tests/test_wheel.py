"""What travels to somebody else's machine: the four packages, whole, and nothing beside them."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("quadsim", "courses", "controllers", "web")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    command = [
        sys.executable,
        "-m",
        "build",
        "--wheel",
        "--no-isolation",
        "--outdir",
        str(folder),
        str(ROOT),
    ]
    subprocess.run(command, check=True, capture_output=True)
    (path,) = folder.glob("*.whl")
    return path


def test_the_wheel_holds_the_four_packages_and_nothing_else(wheel):
    names = {n for n in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in n}
    kinds = (".py", ".yaml", ".typed", ".js", ".npz")
    files = (p for package in PACKAGES for p in (ROOT / package).rglob("*") if p.suffix in kinds)
    assert names == {p.relative_to(ROOT).as_posix() for p in files}
    assert any(n.startswith("courses/") for n in names)
    assert any(n.startswith("quadsim/vehicle/") for n in names)


def test_an_unpacked_wheel_finds_its_courses_and_vehicles(wheel, tmp_path):
    zipfile.ZipFile(wheel).extractall(tmp_path)
    ask = "import quadsim.course as c, quadsim.vehicle as v; print(c.__file__, c.course_names(), v.vehicle_names())"
    answer = subprocess.run(
        [sys.executable, "-c", ask],
        cwd="/",
        env={"PYTHONPATH": str(tmp_path)},
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    assert answer.startswith(str(tmp_path))
    assert "split_s_swift" in answer
    assert "swift" in answer
