"""WrongTokens: an address that sends many wrong tokens is refused for a while."""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Callable
from hashlib import sha256
from time import monotonic

MOST = 10  # different wrong tokens of an address, beyond which it is refused
SPAN = 60.0  # after the last wrong token until an address is forgotten [s]
MOST_ADDRESSES = 1000  # number of addresses that are kept; older ones are forgotten
LOG = logging.getLogger("race web")


class WrongTokens:
    """Counts the different wrong tokens of each address.

    A page that was open before the server started again sends one old token many times, which
    counts once.

    Args:
        clock: returns the time [s].
    """

    def __init__(self, clock: Callable[[], float] = monotonic):
        self._clock = clock
        # digests of the wrong tokens of an address, and when the last new one came [s]
        self._found: OrderedDict[str, tuple[set[bytes], float]] = OrderedDict()

    def is_refused(self, address: str) -> bool:
        """Return whether an address has guessed too often, and has to wait."""
        tokens, last = self._found.get(address, (set(), 0.0))
        if tokens and self._clock() - last > SPAN:
            del self._found[address]
            return False
        return len(tokens) >= MOST

    def add(self, address: str, token: str) -> None:
        """Count a wrong token; the one that is too many is said in the log."""
        tokens, last = self._found.pop(address, (set(), self._clock()))
        digest = sha256(token.encode("utf-8", "surrogateescape")).digest()
        if digest not in tokens:
            tokens.add(digest)
            last = self._clock()
            if len(tokens) == MOST:
                LOG.warning(
                    "race web: %d wrong tokens from %s: it is refused for %g s", MOST, address, SPAN
                )
        self._found[address] = (tokens, last)
        while len(self._found) > MOST_ADDRESSES:
            self._found.popitem(last=False)
