"""Claims about how often the page is updated."""

import time

from quadsim.web.page.due import Calm


def test_it_is_calm_once_nothing_has_changed_for_the_period_and_a_change_ends_that():
    is_calm = Calm(0.01)
    assert not is_calm("a")
    time.sleep(0.02)
    assert is_calm("a")
    assert not is_calm("b")
