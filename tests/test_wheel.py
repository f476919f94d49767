"""The wheel holds one package, whole, and nothing else, and works unpacked."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FOLDERS = ("quadsim", "courses", "controllers", "web")
KINDS = (".py", ".yaml", ".typed", ".js", ".css", ".html", ".npz", ".onnx", ".txt", ".c")
QUESTION = """
import quadsim.course, quadsim.vehicle
print(quadsim.course.__file__)
print(quadsim.course.load_course("split_s_swift").name)
print(quadsim.vehicle.load_vehicle("swift").name)
"""


@pytest.mark.process
def test_an_unpacked_wheel_is_whole_and_finds_its_courses_and_vehicles(tmp_path):
    # from the source distribution, as pip builds it for a user
    build = [sys.executable, "-m", "build", "--no-isolation"]
    subprocess.run([*build, "--outdir", tmp_path, ROOT], check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        archive.extractall(tmp_path)
    files = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*")]
    expected = {p.relative_to(ROOT).as_posix() for p in files if p.suffix in KINDS}
    assert names == {f"quadsim/{name.removeprefix('quadsim/')}" for name in expected}

    answer = subprocess.run(
        [sys.executable, "-c", QUESTION],
        cwd="/",
        env={"PYTHONPATH": str(tmp_path)},
        check=True,
        capture_output=True,
        text=True,
    )
    file, course, vehicle = answer.stdout.splitlines()
    assert file.startswith(str(tmp_path))
    assert (course, vehicle) == ("split_s_swift", "swift")
