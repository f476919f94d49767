"""Whether the environment lets numba compile the planner."""

from __future__ import annotations

import os
import warnings

from quadsim.console import UsageError


def check_compiler() -> None:
    """Raises UsageError where a NUMBA_ variable keeps numba from compiling, here or in a worker."""
    given = ", ".join(
        f"{name}={value!r}"
        for name, value in sorted(os.environ.items())
        if name.startswith("NUMBA_")
    )
    if given and (problem := _compiler_problem()):
        raise UsageError(f"{given}: {problem}: unset it, or give it a value that numba knows")


def _compiler_problem() -> str:
    """What numba says of its variables: the first line, or ""."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            import numba

            if numba.config.DISABLE_JIT:  # pyright: ignore[reportPrivateImportUsage, reportAttributeAccessIssue]
                return "the planner has to be compiled"
            from controllers.lanes.threads import use_threads

            use_threads(None)
        except (ValueError, ImportError, RuntimeError) as error:
            return str(error).splitlines()[0].rstrip(".")
    unread = [
        str(warning.message) for warning in said if "Environment variable" in str(warning.message)
    ]
    return unread[0].splitlines()[0].rstrip(".") if unread else ""
