"""`race`: a table of commands, each a dataclass of flags with run() in a module that is loaded when asked for."""

from __future__ import annotations

import sys
from importlib import import_module

COMMANDS = {  # name -> module:class, what it does
    "fly": ("quadsim.app.fly:Fly", "fly a course and report laps, splits, crashes, chatter, plan time"),
}


def main() -> None:
    sys.exit(race(sys.argv[1:]))


def race(argv: list[str]) -> int:
    from quadsim.app.flags import UsageError, read
    from quadsim.run import RunError
    from quadsim.strict_yaml import FileError

    name, rest = argv[0], argv[1:]
    prog = f"race {name}"
    module, _, cls = COMMANDS[name][0].partition(":")
    command = getattr(import_module(module), cls)
    try:
        default = command.defaults(rest) if hasattr(command, "defaults") else None
        return read(command, prog, rest, default).run()
    except (UsageError, FileError, RunError) as error:
        print(f"{prog}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
