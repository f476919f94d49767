"""A multilayer perceptron in numpy: two hidden layers of tanh, its gradient by hand, and Adam."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

Weights = list[np.ndarray]  # W, b of each layer in turn; W (inputs, outputs), b (outputs,)


def new(sizes: Sequence[int], rng: np.random.Generator, last: float = 0.01) -> Weights:
    """Return new weights: orthogonal matrices and no bias.

    Args:
        sizes: numbers of inputs, of each hidden layer, and of outputs.
        rng: the generator to draw from.
        last: scale of the last matrix; those of hidden layers are scaled for tanh.
    """
    found: Weights = []
    for k, (n, m) in enumerate(pairwise(sizes)):
        gain = last if k == len(sizes) - 2 else np.sqrt(2.0)
        q, _ = np.linalg.qr(rng.normal(size=(max(n, m), min(n, m))))
        matrix = q if n >= m else q.T
        found += [(gain * matrix).astype(np.float32), np.zeros(m, np.float32)]
    return found


def forward(w: Weights, x: np.ndarray) -> np.ndarray:
    """Return the outputs for inputs x, (rows, inputs) or (inputs,)."""
    for k in range(0, len(w) - 2, 2):
        x = np.tanh(x @ w[k] + w[k + 1])
    return x @ w[-2] + w[-1]


def activations(w: Weights, x: np.ndarray) -> list[np.ndarray]:
    """Return the inputs of every layer, and the outputs of the last."""
    found = [x]
    for k in range(0, len(w), 2):
        x = x @ w[k]
        x += w[k + 1]
        found.append(np.tanh(x, out=x) if k < len(w) - 2 else x)
    return found


def gradient(w: Weights, of_layers: list[np.ndarray], d_out: np.ndarray) -> Weights:
    """Return the gradient of a loss with respect to the weights, summed over rows.

    Args:
        w: the weights.
        of_layers: the activations, see `activations`.
        d_out: gradient with respect to the outputs  (rows, outputs).
    """
    found: Weights = []
    for k in range(len(w) - 2, -1, -2):
        x = of_layers[k // 2]
        found[:0] = [x.T @ d_out, d_out.sum(0)]
        if k:
            d_out = d_out @ w[k].T
            d_out *= 1 - x * x
    return found


class Adam:
    """The optimiser of Kingma and Ba 2015, in place.

    Args:
        w: the weights to optimise.
        most: norm that a gradient is first scaled down to.
    """

    def __init__(self, w: Weights, most: float = 1.0):
        self.first = [np.zeros_like(a) for a in w]
        self.second = [np.zeros_like(a) for a in w]
        self.steps = 0
        self.most = most

    def step(self, w: Weights, g: Weights, rate: float) -> None:
        """Move the weights w by one step against the gradient g at this learning rate."""
        norm = float(np.sqrt(sum(float(np.vdot(a, a)) for a in g)))
        scale = min(1.0, self.most / (norm + 1e-8))
        self.steps += 1
        fresh = rate * np.sqrt(1 - 0.999**self.steps) / (1 - 0.9**self.steps)
        for a, da, m, v in zip(w, g, self.first, self.second, strict=True):
            da = da * np.float32(scale)
            m += np.float32(0.1) * (da - m)
            v += np.float32(0.001) * (da * da - v)
            a -= np.float32(fresh) * m / (np.sqrt(v) + np.float32(1e-8))
