"""Import optional packages, the extras of pyproject.toml, or say how to install them."""

from __future__ import annotations

import shlex
import sys
from importlib import import_module, metadata
from typing import Any


def needs_extra(package: str, extra: str) -> str:
    """Return a line that names a missing package and the command that installs it.

    The command names packages rather than the extra, because this project is in no package index.

    Args:
        package: the missing package. The command installs only this package if the project's
            metadata lacks the extra.
        extra: a name among the optional dependencies of pyproject.toml.
    """
    marker = f"extra == '{extra}'"
    requirements = metadata.requires("quadsim") or []
    of_extra = [line.partition(";")[0] for line in requirements if marker in line]
    packages = shlex.join(of_extra or [package])
    return f"{package} is not installed: {sys.executable} -m pip install {packages}"


def imported(module: str, package: str, extra: str) -> Any:
    """Import a module of an optional package.

    Args:
        module: the module's name.
        package: the package that has it.
        extra: the extra of the package, see `needs_extra`.

    Raises:
        ModuleNotFoundError: the package is not installed; the message says how to install it.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError:
        raise ModuleNotFoundError(needs_extra(package, extra), name=module) from None
