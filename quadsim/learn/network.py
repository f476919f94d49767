"""Networks that learn, in numpy: their outputs, their gradients and the steps of Adam.

A network of 64 neurons is so small that a library of automatic differentiation spends more time on
its own bookkeeping than on the arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from controllers.learned.pilot import forward

HIDDEN_GAIN = 2**0.5  # of the first weights, as half of the neurons of a hidden layer are silent


class Network:
    """A multilayer perceptron with rectified linear units between its layers (ReLU).

    Args:
        sizes: numbers of inputs, of neurons of each hidden layer, and of outputs.
        gain: scale of the last layer's first weights.
        rng: draws the first weights, orthogonal matrices.

    Attributes:
        weights: matrix (inputs, outputs) and bias (outputs,) of each layer in turn.
        gradients: sums of what `backward` found, in the same shapes.
    """

    def __init__(self, sizes: Sequence[int], gain: float, rng: np.random.Generator):
        self.weights: list[np.ndarray] = []
        layers = list(pairwise(sizes))
        for number, (inputs, outputs) in enumerate(layers):
            scale = gain if number == len(layers) - 1 else HIDDEN_GAIN
            matrix = scale * _orthogonal(inputs, outputs, rng)
            self.weights += [matrix.astype(np.float32), np.zeros(outputs, np.float32)]
        self.gradients = [np.zeros_like(array) for array in self.weights]
        self._inputs: list[np.ndarray] = []  # of each layer, in the last call of `forward`

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return the outputs of rows of inputs.  (rows, inputs) -> (rows, outputs)"""
        return forward(self.weights, x, "relu")

    def forward(self, x: np.ndarray) -> np.ndarray:
        """Return the outputs as `__call__` does, and keep what `backward` needs."""
        *hidden, matrix, bias = self.weights
        self._inputs = [x]
        for k in range(0, len(hidden), 2):
            x = np.maximum(x @ hidden[k] + hidden[k + 1], 0.0)
            self._inputs.append(x)
        return x @ matrix + bias

    def backward(self, slope: np.ndarray) -> None:
        """Add the gradient of a loss to `gradients`.

        Args:
            slope: derivative of the loss by each output of the last `forward`.  (rows, outputs)
        """
        for k in range(len(self.weights) - 2, -1, -2):
            entered = self._inputs[k // 2]
            self.gradients[k] += entered.T @ slope
            self.gradients[k + 1] += slope.sum(axis=0)
            if k:
                slope = (slope @ self.weights[k].T) * (entered > 0.0)


def _orthogonal(inputs: int, outputs: int, rng: np.random.Generator) -> np.ndarray:
    """Return a random matrix whose rows or columns, the fewer of them, are orthonormal."""
    tall = rng.normal(size=(max(inputs, outputs), min(inputs, outputs)))
    found, _ = np.linalg.qr(tall)
    return found if inputs >= outputs else found.T


class Adam:
    """The optimiser of Kingma and Ba 2015, which changes arrays in place.

    Args:
        arrays: the parameters.
        longest: the gradient is shortened to this length.

    Attributes:
        first, second: running means of the gradient and of its square.
        count: number of steps.
    """

    def __init__(self, arrays: Sequence[np.ndarray], longest: float):
        self.arrays = list(arrays)
        self.longest = longest
        self.first = [np.zeros_like(array) for array in arrays]
        self.second = [np.zeros_like(array) for array in arrays]
        self.count = 0

    def step(self, gradients: Sequence[np.ndarray], rate: float) -> None:
        """Take a step against the gradient, and set the gradient to zero.

        Args:
            gradients: in the shapes of the arrays.
            rate: learning rate.
        """
        length = np.sqrt(sum(float(np.vdot(g, g)) for g in gradients))
        shorter = np.float32(min(1.0, self.longest / (length + 1e-6)))
        self.count += 1
        # The means begin at zero; this makes up for it.
        rate /= 1 - FIRST**self.count
        unbiased = np.float32(1 / (1 - SECOND**self.count))
        for array, gradient, first, second in zip(
            self.arrays, gradients, self.first, self.second, strict=True
        ):
            gradient *= shorter
            first *= np.float32(FIRST)
            first += np.float32(1 - FIRST) * gradient
            second *= np.float32(SECOND)
            second += np.float32(1 - SECOND) * gradient * gradient
            array -= np.float32(rate) * first / (np.sqrt(second * unbiased) + LEAST)
            gradient[:] = 0.0


# Shares of the old means that a step keeps, and the least divisor
FIRST = 0.9
SECOND = 0.999
LEAST = np.float32(1e-5)
