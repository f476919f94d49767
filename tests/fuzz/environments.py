"""Environment variables and closed streams, each command in an interpreter of its own."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

from tests.fuzz.base import FLIGHTS, SHORT, base
from tests.fuzz.harness import Case

VARIABLES = {
    "NUMBA_DISABLE_JIT": ("1", "0", "x"),
    "NUMBA_NUM_THREADS": ("0", "-1", "x", "1", "1000"),
    "NUMBA_THREADING_LAYER": ("tbb", "omp", "workqueue", "foo"),
    "NUMBA_OPT": ("0", "x"),
    "NUMBA_CACHE_DIR": ("/proc", "{here}"),
    "NUMBA_CACHE_LOCATOR_CLASSES": ("foo",),
    "NUMBA_BOUNDSCHECK": ("x",),
    "XDG_CACHE_HOME": ("/proc", "/dev/null", "relative", "", "{here}/here.yaml"),
    "HOME": ("/nonexistent", "", "unset", "relative"),
    "MPLBACKEND": ("nix", "TkAgg", "", "module://no.such"),
    "MPLCONFIGDIR": ("/proc", "/dev/null", "{here}/mpl"),
    "FORCE_COLOR": ("1", "0", ""),
    "NO_COLOR": ("1", ""),
    "COLUMNS": ("0", "1", "x", "-5", "100000"),
    "LINES": ("0", "x"),
    "TERM": ("dumb", "foo", "", "xterm-256color", "unset"),
    "LC_ALL": ("C", "POSIX", "xx_YY.UTF-8", ""),
    "PYTHONIOENCODING": ("ascii", "latin-1", "utf-16"),
    "PYTHONUTF8": ("0", "1"),
    "PYTHONOPTIMIZE": ("1", "2"),
    "PYTHONWARNINGS": ("error", "always", "x"),
    "TMPDIR": ("/proc", "/nonexistent"),
    "TZ": ("nowhere", "XYZ-99"),
    "PATH": ("", "/nonexistent"),
    "OMP_NUM_THREADS": ("0", "x", "1"),
    "OPENBLAS_NUM_THREADS": ("0", "x", "1"),
}
COMMANDS = (
    ("fly", *FLIGHTS[0], *SHORT),
    ("fly", *FLIGHTS[0], *SHORT, "--json"),
    ("courses",),
    ("show",),
    ("plot",),
    ("export", "--csv"),
    ("check", "here.yaml"),
    ("fly", "--help"),
    ("fly", "split_s_swfit"),
)


def environments(rng: random.Random) -> Case:
    """Return a case with one or two variables, and now and then closed streams."""
    names = rng.sample(sorted(VARIABLES), rng.choice((1, 1, 2)))
    env = {name: rng.choice(VARIABLES[name]) for name in names}
    closed: tuple[int, ...] = ()
    if rng.random() < 0.3:
        closed = tuple(sorted(rng.sample(range(3), rng.choice((1, 2, 3)))))
    argv = rng.choice(COMMANDS)
    variables = " ".join(f"{name}={value!r}" for name, value in env.items())
    label = f"{variables} {' '.join(argv)} closed: {closed}"
    return Case("environments", label, argv, _with_run, env=env, closed=closed, fresh=True)


def _with_run(folder: Path) -> None:
    shutil.copytree(base().runs[0], folder / "runs" / base().runs[0].name)
    (folder / "here.yaml").write_text("gates: 3\n")
