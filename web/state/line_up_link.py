"""A line-up as a part of an address: what START flies, for everybody who opens the address."""

from __future__ import annotations

from base64 import urlsafe_b64decode, urlsafe_b64encode
from binascii import Error

import msgspec

from quadsim.web.state.commands import SetUp
from quadsim.web.state.page_state import PageState

MOST_BYTES = 2000  # length of a line-up in an address, at most


def line_up_text(state: PageState) -> str:
    """Return what START flies as a part of an address.

    Raises:
        ValueError: the line-up is too long for an address.
    """
    asked = SetUp(
        race=state.race,
        competitors=tuple(row.choices for row in state.rows),
        world=state.world,
        expect=state.expect,
        rules=state.rules,
    )
    built = msgspec.to_builtins(asked)
    # The folder of runs is each server's own.
    del built["race"]["runs_dir"], built["visitor"]
    data = urlsafe_b64encode(msgspec.json.encode(built)).decode().rstrip("=")
    if len(data) > MOST_BYTES:
        raise ValueError(f"link: expected a line-up of {MOST_BYTES} letters, got {len(data)}")
    return data


def set_up_of(text: str) -> SetUp:
    """Return the command that sets up a line-up of an address. Raises ValueError."""
    try:
        data = urlsafe_b64decode(text + "=" * (-len(text) % 4))
        return msgspec.json.decode(data, type=SetUp)
    except (Error, msgspec.DecodeError, UnicodeError) as error:
        problem = " ".join(str(error).split())[:120]
        raise ValueError(f"link: expected a line-up, got another text: {problem}") from None
