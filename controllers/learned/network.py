"""A multilayer perceptron in numpy: two hidden layers of tanh, its gradient by hand, and Adam."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

Weights = list[np.ndarray]  # W, b of each layer in turn; W (inputs, outputs), b (outputs,)


def new(sizes: Sequence[int], rng: np.random.Generator, last: float = 0.01) -> Weights:
    """Orthogonal matrices, those of hidden layers scaled for tanh, the last one by `last`; no
    bias."""
    found: Weights = []
    for k, (n, m) in enumerate(pairwise(sizes)):
        gain = last if k == len(sizes) - 2 else np.sqrt(2.0)
        q, _ = np.linalg.qr(rng.normal(size=(max(n, m), min(n, m))))
        found += [(gain * (q if n >= m else q.T)).astype(np.float32), np.zeros(m, np.float32)]
    return found


def forward(w: Weights, x: np.ndarray) -> np.ndarray:
    """The outputs for rows of inputs.  x (rows, inputs) or (inputs,)"""
    for k in range(0, len(w) - 2, 2):
        x = np.tanh(x @ w[k] + w[k + 1])
    return x @ w[-2] + w[-1]


def activations(w: Weights, x: np.ndarray) -> list[np.ndarray]:
    """Inputs of every layer, and the outputs of the last."""
    found = [x]
    for k in range(0, len(w), 2):
        x = x @ w[k]
        x += w[k + 1]
        found.append(np.tanh(x, out=x) if k < len(w) - 2 else x)
    return found


def gradient(w: Weights, of_layers: list[np.ndarray], d_out: np.ndarray) -> Weights:
    """Of a loss with respect to the weights, from that with respect to the outputs, summed over
    rows."""
    found: Weights = []
    for k in range(len(w) - 2, -1, -2):
        x = of_layers[k // 2]
        found[:0] = [x.T @ d_out, d_out.sum(0)]
        if k:
            d_out = d_out @ w[k].T
            d_out *= 1 - x * x
    return found


class Adam:
    """Kingma and Ba 2015, in place. The gradient is first scaled down to a norm of at most
    `most`."""

    def __init__(self, w: Weights, most: float = 1.0):
        self.first, self.second = [np.zeros_like(a) for a in w], [np.zeros_like(a) for a in w]
        self.steps, self.most = 0, most

    def step(self, w: Weights, g: Weights, rate: float) -> None:
        norm = float(np.sqrt(sum(float(np.vdot(a, a)) for a in g)))
        scale = min(1.0, self.most / (norm + 1e-8))
        self.steps += 1
        fresh = rate * np.sqrt(1 - 0.999**self.steps) / (1 - 0.9**self.steps)
        for a, da, m, v in zip(w, g, self.first, self.second, strict=True):
            da = da * np.float32(scale)
            m += np.float32(0.1) * (da - m)
            v += np.float32(0.001) * (da * da - v)
            a -= np.float32(fresh) * m / (np.sqrt(v) + np.float32(1e-8))
