"""Names on the pages of the repository that nothing bears: files, code, commands, flags, marks.

A name is what stands between backticks in a sentence or a table, a line of commands, a link, or an
import in a block of Python. Code is looked up in the source text, without importing it.

A name is looked up if it is one of these; anything else on a page is left alone:

* a path whose first folder is one of the repository, or a file of code by its name alone;
* a dotted name that begins with a package of the project, and the member of a class of the project;
* `race COMMAND`, each flag that stands with it or alone, and each setting of a variant;
* a keyword of `quadsim.fly`, `quadsim.frames`, `quadsim.race` and `quadsim.compare`;
* `make TARGET`, `pytest PATH`, `python FILE`, `python -m MODULE`, `pip install`, `dask COMMAND`;
* a test or a mark of pytest.
"""

from __future__ import annotations

import ast
import re
import shlex
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib import metadata
from importlib.util import find_spec
from inspect import signature
from pathlib import Path

import quadsim
from quadsim.cli.commands import COMMANDS
from quadsim.cli.parse import application
from tests.docs.pages import ROOT, SPAN, Block, blocks, is_command

PACKAGES = ("quadsim", "controllers", "web")
FOLDERS = (*PACKAGES, "courses", "examples", "docs", "tests", ".ci", ".github")
CODE = ("py", "c", "js", "css", "toml", "md", "ipynb")

# Names that are no file or code of the repository, each with its reason
LEFT_ALONE = {
    "quadsim/sensing/altimeter.py",  # the file that the example of docs/own_sensor.md adds
    "quadsim/Racing-v0",  # environments of Gymnasium
    "quadsim/RacingBullet-v0",
    "quadsim.Command",  # messages of a recording
    "quadsim.Event",
    "quadsim.Telemetry",
}
FILE = re.compile(r"[\w.*-]+(/[\w.*-]*)+")
BARE_FILE = re.compile(rf"\w+\.({'|'.join(CODE)})")
DOTTED = re.compile(rf"({'|'.join(PACKAGES)})(\.\w+)+")
MEMBER = re.compile(r"([A-Z]\w+)\.(\w+)")
MARK = re.compile(r"@pytest\.mark\.(\w+)")
TEST = re.compile(r"test_\w+")
FLAG = re.compile(r"--[a-z][\w-]*")
# "name=colored+link-hz=40": a setting of a variant or of an entrant
SETTING = re.compile(r"\+([a-z][\w-]*)=")
PIP = re.compile(r"\bpip install [^`\n#]+")
LINK = re.compile(r"\]\(([^)\s]+)\)")
API_ENTRY = re.compile(r"^::: (\S+)$", re.MULTILINE)
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
# "NAME=value " in front of a command sets its environment.
ENVIRONMENT = re.compile(r"^([A-Z_]+=\S* )+")
REQUIREMENT = re.compile(r"([\w-]+)(?:\[[\w,]+\])?(.*)")

# Functions of the public interface that take the settings of a flight as keywords
TAKE_SETTINGS = ("fly", "frames", "race", "compare")
# Settings that are objects and no flags
OWN_PARTS = {"terms", "cost", "plant", "controller", "referee", "planner", "model", "pilot", "term"}

MAKEFILE = (ROOT / "Makefile").read_text()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def pages() -> list[Path]:
    """Return every page of the repository; the changelog names what was."""
    folders = [ROOT / folder for folder in FOLDERS]
    found = [*ROOT.glob("*.md"), *(page for folder in folders for page in folder.rglob("*.md"))]
    return sorted(page for page in found if page.name != "CHANGELOG.md")


def missing_names(page: Path) -> list[str]:
    """Return the names on a page that nothing bears."""
    return [name for name in dict.fromkeys(_names(page)) if not _exists(name)]


def missing_links(page: Path) -> list[str]:
    """Return the links of a page to files and headings of the repository that do not exist."""
    missing = []
    for link in LINK.findall(page.read_text()):
        name, _, heading = link.partition("#")
        target = page.parent / name if name else page
        if "://" in link:
            continue
        if target.parent.name == "gallery" and target.suffix == ".html":
            target = target.with_suffix(".zip")  # docs/site_hooks.py makes the page of it
        if target.parent == ROOT / "docs" / "notebooks":  # made by docs/site_hooks.py, too
            target = ROOT / "examples" / "notebooks" / f"{target.stem}.ipynb"
        if not target.exists() or (heading and heading not in _headings(target)):
            missing.append(link)
    return missing


def missing_flags(page: Path) -> list[str]:
    """Return the flags on a page that no command of `race` has, or not the one they stand with."""
    missing = [flag for command in _commands(page) for flag in unknown_flags(command)]
    known = set().union(*map(flags_of, COMMANDS))
    for span in _spans(page):
        if span.startswith("--"):
            missing += [flag for flag in FLAG.findall(span) if flag not in known]
            missing += [name for name in SETTING.findall(span) if not _is_setting(name)]
    return missing


def unknown_flags(command: str) -> list[str]:
    """Return the flags and the settings of variants that a command of `race` does not take."""
    program, *words = command.split()
    if program != "race" or words[0] not in COMMANDS:
        return []
    flags = [FLAG.match(word) for word in words]
    unknown = [flag[0] for flag in flags if flag and flag[0] not in flags_of(words[0])]
    settings = [name for name in SETTING.findall(command) if not _is_setting(name)]
    return [f"race {words[0]} {name}" for name in (*unknown, *settings)]


def missing_keywords(page: Path) -> list[str]:
    """Return the keywords on a page that a function of `import quadsim` does not take."""
    blocks_of_python = ("\n".join(b.lines) for b in _blocks(page) if b.kind in ("python", "py"))
    missing = []
    for source in (*blocks_of_python, *_spans(page)):
        with suppress(SyntaxError):
            calls = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
            for call in calls:
                function = ast.unparse(call.func).removeprefix("quadsim.")
                if ast.unparse(call.func) == f"quadsim.{function}" and function in TAKE_SETTINGS:
                    given = {keyword.arg for keyword in call.keywords if keyword.arg}
                    known = _parameters(function)
                    names = [name for name in given - known if not _is_setting(name)]
                    missing += [f"{function}({name}=)" for name in names]
    return missing


@cache
def _parameters(function: str) -> frozenset[str]:
    """Return the parameters of a function of the public interface."""
    return frozenset(signature(getattr(quadsim, function)).parameters)


def _is_setting(name: str) -> bool:
    """Return whether a flight or a race has a setting of this name, with _ or -."""
    flag = "--" + name.replace("_", "-")
    return any(one in flags_of("heat") for one in (flag, f"--no-{flag[2:]}")) or name in OWN_PARTS


@cache
def flags_of(command: str) -> frozenset[str]:
    """Return the flags that a command of `race` takes."""
    arguments = application()[command].assemble_argument_collection()
    names = {name for argument in arguments for name in argument.names}
    return frozenset({name for name in names if name.startswith("--")} | {"--help"})


def _names(page: Path) -> Iterator[str]:
    """Yield everything on a page that may be a name."""
    yield from _spans(page)
    yield from _commands(page)
    yield from API_ENTRY.findall(page.read_text())
    yield from PIP.findall(page.read_text())
    for block in _blocks(page):
        if block.kind in ("python", "py"):
            yield from _imports("\n".join(block.lines))


def _blocks(page: Path) -> list[Block]:
    return [block for section in blocks(page) for block in section]


def _spans(page: Path) -> Iterator[str]:
    """Yield what stands between backticks in sentences and tables."""
    for block in _blocks(page):
        if block.kind in ("prose", "table"):
            # A span may be broken over two lines.
            yield from SPAN.findall(" ".join(line.strip() for line in block.lines))


def _commands(page: Path) -> Iterator[str]:
    """Yield the command lines of a page, a command of several lines as one."""
    for block in _blocks(page):
        if block.kind != "":
            continue
        text = re.sub(r"\n\s*(?=--)", " ", "\n".join(block.lines))
        for line in text.splitlines():
            entered = re.sub(r"\s+# .*", "", line.strip().removeprefix("$ "))
            entered = ENVIRONMENT.sub("", entered)
            if is_command(entered):
                yield entered
    for span in _spans(page):
        if is_command(span):
            yield span


def _imports(source: str) -> Iterator[str]:
    """Yield the dotted names that a block of Python imports from the project."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if "." in alias.name)
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _exists(name: str) -> bool:
    """Return whether something of the project bears a name, or it is no such name."""
    if name in LEFT_ALONE:
        return True
    if is_command(name):
        return is_taken(name)
    if name.startswith(".ci/"):
        return (ROOT / name.split()[0]).exists()
    if match := MARK.search(name):
        marks = PROJECT["tool"]["pytest"]["ini_options"]["markers"]
        return match[1] in {mark.partition(":")[0] for mark in marks}
    if TEST.fullmatch(name):
        return name in _tests()
    if FILE.fullmatch(name) and name.partition("/")[0] in FOLDERS:
        return any(map(_holds_something, ROOT.glob(name.rstrip("/"))))
    if BARE_FILE.fullmatch(name):
        return name in _files()
    if match := DOTTED.match(name):
        return _is_code(match[0])
    if (match := MEMBER.match(name)) and _classes(match[1]):
        return any(match[2] in _members_of_class(node) for node in _classes(match[1]))
    return True


def _holds_something(path: Path) -> bool:
    """Return whether a path is a file, or a folder with more than what Python has left there."""
    if not path.is_dir():
        return path.exists()
    return any("__pycache__" not in found.parts for found in path.rglob("*") if found.is_file())


def is_taken(command: str) -> bool:
    """Return whether a program takes the first words of a command line; flags are left out."""
    program, *words = shlex.split(command)
    words = [word for word in words if not word.startswith("[")]
    if program == "race":
        return words[0] in COMMANDS or words[0] in ("--version", "--completion", "--help")
    if program == "make":
        variables = [word.partition("=")[0] for word in words if "=" in word]
        targets = [word for word in words if "=" not in word]
        return all(f"\n{target}:" in MAKEFILE for target in targets) and all(
            f"$({variable})" in MAKEFILE for variable in variables
        )
    if program == "pytest":
        return all((ROOT / word.partition("::")[0]).exists() for word in words if "/" in word)
    if program.endswith("python"):
        return find_spec(words[1]) is not None if words[0] == "-m" else (ROOT / words[0]).exists()
    if program == "pip":
        # Without --editable a copy of the checkout would take the place of the checkout.
        is_checkout = any(word.startswith(".") for word in words)
        named = [word for word in words[1:] if not word.startswith("-")]
        return all(map(_is_required, named)) and ("--editable" in words) == is_checkout
    if program == "dask":
        return words[0] in {entry.name for entry in metadata.entry_points(group="dask_cli")}
    # printf and sqlite3 are nothing of the project; tests/docs/test_pages.py runs the queries.
    return True


def _is_required(word: str) -> bool:
    """Return whether a word of `pip install` is one of the project's requirements.

    The checkout with one of its extras is written ".[extra]"; the name of the project alone would
    be looked for in a package index, which does not have it.
    """
    extras = PROJECT["project"]["optional-dependencies"]
    if match := re.fullmatch(r"\.\[([\w,]+)\]", word):
        return set(match[1].split(",")) <= set(extras)
    if word.endswith(".whl"):
        return f"/quadsim-{PROJECT['project']['version']}-" in word
    lines = [line for extra in extras.values() for line in extra]
    required = dict(REQUIREMENT.findall(line)[0] for line in lines)
    required.pop(PROJECT["project"]["name"])
    name, version = REQUIREMENT.findall(word)[0]
    return name in required and version in ("", required[name])


@cache
def _files() -> frozenset[str]:
    """Return the names of all files of the repository."""
    inside = (path for folder in FOLDERS for path in (ROOT / folder).rglob("*"))
    return frozenset(path.name for path in (*ROOT.iterdir(), *inside) if path.is_file())


@cache
def _headings(page: Path) -> frozenset[str]:
    """Return the anchors of a page's headings."""
    texts = [re.sub(r"[^\w\s-]", "", text) for text in HEADING.findall(page.read_text())]
    return frozenset(re.sub(r"\s+", "-", text.strip().lower()) for text in texts)


@cache
def _tests() -> frozenset[str]:
    """Return the names of all tests and of their files."""
    files = list((ROOT / "tests").rglob("test_*.py"))
    found = [re.findall(r"^ *def (test_\w+)", file.read_text(), re.MULTILINE) for file in files]
    return frozenset([name for names in found for name in names] + [file.stem for file in files])


def _source(module: str) -> Path | None:
    """Return the file of a module or package, None if there is none."""
    path = ROOT.joinpath(*module.split("."))
    files = (path / "__init__.py", path.with_suffix(".py"))
    return next((file for file in files if file.exists()), None)


@cache
def _tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text())


def _is_code(name: str) -> bool:
    """Return whether a dotted name is a module, or something that stands in one."""
    parts = name.split(".")
    for n in range(len(parts), 0, -1):
        file = _source(".".join(parts[:n]))
        if file:
            return not parts[n:] or _has(file, parts[n:])
    return False


def _has(file: Path, names: list[str]) -> bool:
    """Return whether a module has a name, and that the following names."""
    first, *others = names
    for node in _top_level(_tree(file)):
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            for alias in node.names:
                if (alias.asname or alias.name) == first:
                    home = ".".join([node.module, alias.name, *others])
                    return _is_code(home) or node.module.partition(".")[0] not in PACKAGES
        if isinstance(node, ast.ClassDef) and node.name == first:
            return not others or others[0] in _members_of_class(node)
        if first in _bound(node):
            return not others
    return False


def _top_level(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yield the statements of a module, those within `if` and `try` as well."""
    waiting = list(tree.body)
    while waiting:
        node = waiting.pop(0)
        yield node
        if isinstance(node, ast.If | ast.Try):
            waiting += [*node.body, *node.orelse]


def _bound(node: ast.stmt) -> set[str]:
    """Return the names that a statement binds; `__getattr__` binds the names that it compares."""
    match node:
        case ast.FunctionDef(name="__getattr__"):
            constants = (n.value for n in ast.walk(node) if isinstance(n, ast.Constant))
            return {value for value in constants if isinstance(value, str)}
        case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
            return {node.name}
        case ast.Import():
            return {alias.asname or alias.name for alias in node.names}
        case ast.Assign():
            targets = [part for target in node.targets for part in ast.walk(target)]
            return {part.id for part in targets if isinstance(part, ast.Name)}
        case ast.AnnAssign(target=ast.Name()):
            return {node.target.id}
    return set()


@cache
def _sources() -> dict[Path, str]:
    """Return the text of every file of Python of the project."""
    files = (file for package in PACKAGES for file in (ROOT / package).rglob("*.py"))
    return {file: file.read_text() for file in files}


@cache
def _classes(name: str) -> list[ast.ClassDef]:
    """Return the classes of the project that bear a name."""
    files = [file for file, text in _sources().items() if f"class {name}" in text]
    nodes = (node for file in files for node in _tree(file).body)
    return [node for node in nodes if isinstance(node, ast.ClassDef) and node.name == name]


def _members_of_class(node: ast.ClassDef) -> set[str]:
    """Return what a class and its base classes of the project have."""
    own = {name for statement in node.body for name in _bound(statement)}
    bases = [base.id for base in node.bases if isinstance(base, ast.Name)]
    inherited = [_members_of_class(one) for base in bases for one in _classes(base)]
    attributes = {
        target.attr
        for target in ast.walk(node)
        if isinstance(target, ast.Attribute) and isinstance(target.ctx, ast.Store)
    }
    return own.union(attributes, *inherited)
