"""`race web`: the dashboard in a browser, for live flights and replays."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from time import sleep
from typing import Annotated

from msgspec import Meta

from quadsim.cli.commands import EXIT
from quadsim.cli.flags import Help, Json, RunsDir, Stored, course_help
from quadsim.console import UsageError, complain, emit, emit_json, uninterrupted
from quadsim.course import course_names, load_course
from quadsim.heat.archive import run_folders
from quadsim.record.run import RunError
from quadsim.record.whole_files import try_writing

WAKE = 0.5  # [s] period at which the wait checks for signals received by other threads


def web(
    *runs: Stored,
    course: Annotated[str, course_help("course chosen at first")] = "split_s_swift",
    host: Annotated[
        str, Help("address to listen on; any but this machine's own asks for a token")
    ] = "127.0.0.1",
    port: Annotated[int, Meta(ge=0, le=65535), Help("0: a free one")] = 8080,
    behind: Annotated[
        str, Help("address of the page at a proxy, such as https://name/path; asks for a token")
    ] = "",
    token_file: Annotated[
        str, Help("file that keeps the token for the next start; without one it is new each time")
    ] = "",
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """Serve the dashboard on this machine until Ctrl-C: watch, tune, race ghosts, replay.

    race web

    race web last 20261120T133511Z --port 8081

    race web --course mine.yaml --host 192.168.1.7

    race web --behind https://lab.example/race --token-file ~/.race_token
    """
    load_course(course)  # raises an error if the course cannot be read
    try:
        try_writing(Path(runs_dir))
    except RunError as error:
        # Runs can be watched all the same
        complain(f"race web: {error}: flights of this page cannot be stored")
    paths = [folder for run in runs for folder in _folders(run, runs_dir)]
    # imported here, as they load numba and viser, which --help does not need
    from quadsim.web.page.dashboard import Dashboard
    from quadsim.web.page.server.behind import behind_of
    from quadsim.web.page.server.page_server import address, kept_token, new_token, serve
    from quadsim.web.race.page_race import PageRace
    from quadsim.web.race.session import Session
    from quadsim.web.state.choices import Choices
    from quadsim.web.state.menu import Menu

    try:
        proxy = behind_of(behind) if behind else None
        token = new_token(host, proxy)
        if token_file:
            if not token:
                wanted = "expected --behind, or the --host of other machines"
                raise ValueError(f"token-file: {wanted}: {host} asks for no token")
            token = kept_token(Path(token_file).expanduser())
        server = serve(host, port, token, "race", behind=proxy)
    except ValueError as error:  # "port: ..."
        raise UsageError(f"--{error}") from None
    session = Session(runs_dir)
    rivals = [Choices(course=course, sampler=sampler) for sampler in ("colored", "gaussian")]
    page = Dashboard(server, session, Menu.of_everything(course), *rivals)
    if paths:
        session.tell(PageRace.start, [], paths)
    own = address(host, server.get_port())
    url = (proxy.address if proxy else own) + (f"?token={token}" if token else "")
    if json:
        emit_json({"url": url, "pid": os.getpid()})
    else:
        emit(url)
        complain("race web: open the address in a browser; Ctrl-C ends it")
        if proxy:
            complain(f"race web: the proxy forwards requests to {own}")
        forward = forwarding(host, server.get_port(), os.environ.get("SSH_CONNECTION", ""))
        if forward:
            complain(f"race web: on the machine that you came from: {forward}")
    with suppress(KeyboardInterrupt):  # the way a server ends
        while True:
            sleep(WAKE)
    with suppress(KeyboardInterrupt), uninterrupted():
        page.close()
        session.close()
        server.stop()
    return EXIT["interrupted"]


def _folders(run: str, runs_dir: str) -> list[Path]:
    """Return the folders of a stored run or race. Raises RunError or UsageError."""
    try:
        return run_folders(run, runs_dir)
    except RunError:
        if run in course_names():
            raise UsageError(
                f"{run!r}: expected a stored run, got a course: use --course {run}"
            ) from None
        raise


def forwarding(host: str, port: int, connection: str) -> str:
    """Return the command by which a remote visitor reaches a page that only this machine serves.

    Args:
        host, port: address of the page.
        connection: the environment's SSH_CONNECTION: client, its port, server, its port; empty: the
            user did not come by ssh.

    Examples:
        >>> from quadsim.cli.web import forwarding
        >>> forwarding("127.0.0.1", 8080, "192.0.2.7 50514 192.0.2.9 22")
        'ssh -N -L 8080:127.0.0.1:8080 192.0.2.9'
        >>> forwarding("127.0.0.1", 8080, "")
        ''
    """
    parts = connection.split()
    if len(parts) != 4 or host not in ("127.0.0.1", "localhost"):
        return ""
    server, server_port = parts[2:]
    port_option = "" if server_port == "22" else f" -p {server_port}"
    return f"ssh -N -L {port}:127.0.0.1:{port}{port_option} {server}"
