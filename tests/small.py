"""The small planner and the short flight that tests share.

Each horizon costs the compilation of a transform, a second or more, and each set of cost terms that
of a rollout, several seconds. A test that needs another horizon, or a cost of its own, says why.
"""

# Two blocks of samples, so that chunks and threads have something to share.
SMALL = {"samples": 128, "horizon": 40, "iterations": 1}
# A flight that begins and is cut short, for tests that ask how a flight is set up and kept.
SHORT = {**SMALL, "laps": 1, "timeout": 0.3}


def flags(settings: dict[str, object]) -> list[str]:
    """Return settings as the words of a command line."""
    return [
        word
        for name, value in settings.items()
        for word in ("--" + name.replace("_", "-"), str(value))
    ]
