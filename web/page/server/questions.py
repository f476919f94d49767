"""Let the questions of pages wait for an answer until there is something new.

A page asks for what it lacks, and asks again once it has the answer. So a slow or a new page gets
the present state at its own pace, and a page at rest asks and receives almost nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Generic, TypeVar

from quadsim.web.page.server.link import Link, LinkVisitor, Message

Question = TypeVar("Question", bound=Message)


@dataclass(frozen=True)
class _Waiting(Generic[Question]):
    """A question that waits, and the time at which it came [s]."""

    question: Question
    since: float


class Questions(Generic[Question]):
    """Answers the questions of one form; of each page, only the last question waits.

    Args:
        link: takes the questions, and gives the answers.
        form: class of the questions.
        answer_of: returns the answer to a visitor's question that has waited for some time [s];
            None: there is nothing new. It is called on the server's event loop.
        begins: called there at the first question of each visitor.
    """

    def __init__(
        self,
        link: Link,
        form: type[Question],
        answer_of: Callable[[LinkVisitor, Question, float], Message | None],
        begins: Callable[[], object] = lambda: None,
    ):
        self._link = link
        self._answer_of = answer_of
        self._begins = begins
        self._waiting: dict[int, _Waiting[Question]] = {}  # by the visitors' numbers
        self._asked: set[int] = set()  # the visitors that have asked before
        link.on(form, self._ask)
        link.on_leave(self._forget)

    def answer(self) -> None:
        """Answer the questions for which there is something new. Any thread may call it."""
        for visitor in self._link.visitors:
            if visitor.number in self._waiting:
                visitor.soon(self._answer)

    def _ask(self, visitor: LinkVisitor, question: Question) -> None:
        self._waiting[visitor.number] = _Waiting(question, perf_counter())
        if visitor.number not in self._asked:
            self._asked.add(visitor.number)
            self._begins()

    def _forget(self, visitor: LinkVisitor) -> None:
        self._waiting.pop(visitor.number, None)
        self._asked.discard(visitor.number)

    def _answer(self, visitor: LinkVisitor) -> None:
        waiting = self._waiting.pop(visitor.number, None)
        if waiting is None:
            return
        answer = self._answer_of(visitor, waiting.question, perf_counter() - waiting.since)
        if answer is None:
            self._waiting[visitor.number] = waiting
        else:
            visitor.send(answer)
