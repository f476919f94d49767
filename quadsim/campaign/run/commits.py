"""The commits that flew the flights of a campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

COMMIT_DIGITS = 7  # hex digits of a commit that are shown
DIRTY = "-dirty"  # ends the name of a commit whose files had been changed


def mixed_commits(by_name: Mapping[str, Sequence[str]]) -> list[str]:
    """Return remarks on the commits that flew some variants: several commits, changed files.

    Args:
        by_name: the commits that flew each variant.
    """
    found = []
    commits = {commit for of_variant in by_name.values() for commit in of_variant}
    if len(commits) > 1:
        each = "; ".join(f"{name}: {', '.join(map(short, c))}" for name, c in by_name.items())
        advice = "--this-commit counts only flights of the present commit"
        found.append(f"MIXED COMMITS: {each}. {advice}.")
    if any(commit.endswith(DIRTY) for commit in commits):
        found.append(
            "Flown from files that differ from their commit (+): the flights cannot be reproduced "
            "from it."
        )
    return found


def short(code: str) -> str:
    """Return a commit's first digits, with a + if its files had been changed.

    A version, which has a space in it, is returned as it is.
    """
    digits, dirty, _ = code.partition(DIRTY)
    if " " not in digits:
        digits = digits[:COMMIT_DIGITS]
    return f"{digits}+" if dirty else digits
