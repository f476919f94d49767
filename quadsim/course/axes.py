"""Components of vectors along the axes of a frame."""

from __future__ import annotations


def in_frame(d, passage, left, up):
    """Components of the vector d along the axes of a gate's frame.  Each (3,), scalars or rows of
    numbers.

    A plain function, as the compiled lanes inline it.
    """
    return (
        passage[0] * d[0] + passage[1] * d[1] + passage[2] * d[2],
        left[0] * d[0] + left[1] * d[1] + left[2] * d[2],
        up[0] * d[0] + up[1] * d[1] + up[2] * d[2],
    )
