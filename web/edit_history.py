"""History: a draft with those before it and those that were undone, as an immutable record."""

from __future__ import annotations

from dataclasses import dataclass, replace

from web.course_draft import Draft

# Undo goes back this far
LONGEST = 200
# [s] Changes of one number that follow each other faster are one change, as those of an arrow key
TOGETHER = 1.0


@dataclass(frozen=True)
class History:
    """A draft and what undo and redo lead to. Every change returns another history."""

    draft: Draft
    before: tuple[Draft, ...] = ()
    undone: tuple[Draft, ...] = ()
    # what was changed last, and when [s]
    what: object = None
    at: float = 0.0

    def change(self, draft: Draft, what: object = None, now: float = 0.0) -> History:
        """Return the history after a change.

        Args:
            draft: the draft after it.
            what: names what changes; a change of the same that follows soon is one with it. None:
                a change of its own.
            now: time of the change [s].
        """
        if draft.entries == self.draft.entries:
            # another item was chosen
            return replace(self, draft=draft)
        is_same = what is not None and what == self.what and now - self.at < TOGETHER
        before = self.before if is_same else (*self.before, self.draft)[-LONGEST:]
        return History(draft, before, what=what, at=now)

    def undo(self) -> History:
        """Return the history before the last change, itself where there is none."""
        if not self.before:
            return self
        *before, draft = self.before
        return History(draft, tuple(before), (self.draft, *self.undone))

    def redo(self) -> History:
        """Return the history after the change that was undone last, itself where there is none."""
        if not self.undone:
            return self
        draft, *undone = self.undone
        return History(draft, (*self.before, self.draft), tuple(undone))
