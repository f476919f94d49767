"""Check that the environment lets numba compile the planner."""

from __future__ import annotations

import os
import warnings

from quadsim.console import UsageError


def check_compiler() -> None:
    """Check that no NUMBA_ variable keeps the planner from being compiled, here or in a worker.

    Raises:
        UsageError: a variable prevents it.
    """
    variables = {k: v for k, v in sorted(os.environ.items()) if k.startswith("NUMBA_")}
    if not variables:
        return
    problem = _compiler_problem()
    if problem:
        given = ", ".join(f"{name}={value!r}" for name, value in variables.items())
        raise UsageError(f"{given}: {problem}: unset it, or give it a value that numba knows")


def _compiler_problem() -> str:
    """Return the first line of numba's complaint about its variables, or ""."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            import numba

            if numba.config.DISABLE_JIT:  # pyright: ignore[reportPrivateImportUsage, reportAttributeAccessIssue]
                return "the planner has to be compiled"
            from quadsim.controllers.lanes.threads import use_threads

            use_threads(None)
        except (ValueError, ImportError, RuntimeError) as error:
            return _first_line(str(error))
    for warning in caught:
        if "Environment variable" in str(warning.message):
            return _first_line(str(warning.message))
    return ""


def _first_line(text: str) -> str:
    return text.splitlines()[0].rstrip(".")
