"""Products of long, narrow matrices.

BLAS divides such products among threads, which gain nothing here and wait for each other busily: on
two busy cores a fit took ten times its CPU time. Blocks of rows are too small for that.
"""

from __future__ import annotations

import numpy as np

# OpenBLAS starts threads for products of more multiplications than 4 * 65536.
MOST_MULTIPLICATIONS = 200_000


def inner(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Return A' B.

    Args:
        A: (m, k).
        B: (m, l).

    Returns:
        (k, l)
    """
    rows = max(MOST_MULTIPLICATIONS // (A.shape[1] * B.shape[1]), 1)
    whole = len(A) // rows * rows
    blocks = (len(A) // rows, rows)
    total = A[whole:].T @ B[whole:]
    if whole:
        left = A[:whole].reshape(*blocks, A.shape[1])
        right = B[:whole].reshape(*blocks, B.shape[1])
        total += np.matmul(left.transpose(0, 2, 1), right).sum(axis=0)
    return total
