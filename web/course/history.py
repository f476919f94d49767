"""History: a draft with its earlier and its undone versions, as an immutable record."""

from __future__ import annotations

from dataclasses import dataclass, replace

from quadsim.web.course.draft import Draft

# Largest number of steps of undo
LONGEST = 200
# [s] Faster changes of the same number are merged, such as repeated presses of an arrow key
TOGETHER = 1.0


@dataclass(frozen=True)
class History:
    """A draft and its undo and redo steps. Every change returns a new history."""

    draft: Draft
    before: tuple[Draft, ...] = ()
    undone: tuple[Draft, ...] = ()
    # subject of the last change, and its time [s]
    what: object = None
    at: float = 0.0

    def change(self, draft: Draft, what: object = None, now: float = 0.0) -> History:
        """Return the history after a change.

        Args:
            draft: the draft after the change.
            what: subject of the change; quick changes of the same subject are merged. None: never
                merged.
            now: time of the change [s].
        """
        if draft.entries == self.draft.entries:
            # only a different item was chosen
            return replace(self, draft=draft)
        is_same = what is not None and what == self.what and now - self.at < TOGETHER
        before = self.before if is_same else (*self.before, self.draft)[-LONGEST:]
        return History(draft, before, what=what, at=now)

    def undo(self) -> History:
        """Return the history before the last change, or itself if there is none."""
        if not self.before:
            return self
        *before, draft = self.before
        return History(draft, tuple(before), (self.draft, *self.undone))

    def redo(self) -> History:
        """Return the history after the last undone change, or itself if there is none."""
        if not self.undone:
            return self
        draft, *undone = self.undone
        return History(draft, (*self.before, self.draft), tuple(undone))
