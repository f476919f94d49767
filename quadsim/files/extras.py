"""Optional packages: the extras of pyproject.toml, and how to install one that is missing."""

from __future__ import annotations

import shlex
import sys
from importlib import import_module, metadata
from typing import Any


def needs_extra(package: str, extra: str) -> str:
    """Return the line that says which package is missing and what installs it.

    The command names packages and not the extra, as no package index has this project.

    Args:
        package: the package that could not be imported. It is installed alone where the metadata
            of this project does not know the extra.
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
        ModuleNotFoundError: it is not installed; the message is one line that says what to do.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError:
        raise ModuleNotFoundError(needs_extra(package, extra), name=module) from None
