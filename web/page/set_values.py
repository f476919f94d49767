"""SetValues: sets controls to values of the state, and leaves alone what a visitor is changing."""

from __future__ import annotations

from typing import Any

UNKNOWN = object()


class SetValues:
    """Sets a control when the value of the state is another one than before.

    A control that a visitor has just changed holds a value that the state does not have yet: it
    would be overwritten if every value was set again whenever something else changes.
    """

    def __init__(self) -> None:
        self._set: dict[str, Any] = {}

    def __call__(self, name: str, control: Any, value: Any) -> None:
        """Set a control.

        Args:
            name: name of the control.
            control: its handle.
            value: the value of the state.
        """
        if self._set.get(name, UNKNOWN) != value:
            self._set[name] = value
            control.value = value

    def forget(self, *names: str) -> None:
        """Set these controls at the next call in any case; no name: all controls."""
        for name in names or tuple(self._set):
            self._set.pop(name, None)
