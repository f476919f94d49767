"""Networks in numpy: gradients are the slopes of what they compute, and steps go downhill."""

import numpy as np
import pytest

from quadsim.learn.network import Adam, Network


@pytest.fixture
def network():
    net = Network((3, 8, 5, 2), 1.0, np.random.default_rng(0))
    net.weights = [array.astype(np.float64) for array in net.weights]
    net.gradients = [np.zeros_like(array) for array in net.weights]
    return net


X = np.random.default_rng(1).normal(size=(7, 3))
TARGET = np.random.default_rng(2).normal(size=(7, 2))


def loss(net):
    """Half the sum of squared errors."""
    return 0.5 * np.sum((net(X) - TARGET) ** 2)


def test_the_gradient_is_the_slope_of_the_loss(network):
    network.backward(network.forward(X) - TARGET)
    for array, gradient in zip(network.weights, network.gradients, strict=True):
        for place in np.ndindex(array.shape):
            before = array[place]
            array[place] = before + 1e-6
            above = loss(network)
            array[place] = before - 1e-6
            below = loss(network)
            array[place] = before
            assert gradient[place] == pytest.approx((above - below) / 2e-6, rel=1e-4, abs=1e-6)


def test_the_gradient_of_rows_is_the_sum_of_each_ones(network):
    network.backward(network.forward(X) - TARGET)
    together = [gradient.copy() for gradient in network.gradients]
    for gradient in network.gradients:
        gradient[:] = 0.0
    for k in range(len(X)):
        network.backward(network.forward(X[k : k + 1]) - TARGET[k : k + 1])
    for found, expected in zip(network.gradients, together, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-12)


def test_hidden_layers_begin_orthogonal():
    first, _, second, *_ = Network((3, 8, 8, 2), 1.0, np.random.default_rng(0)).weights
    np.testing.assert_allclose(first @ first.T, 2 * np.eye(3), atol=1e-5)
    np.testing.assert_allclose(second @ second.T, 2 * np.eye(8), atol=1e-5)


def test_steps_of_adam_reach_a_minimum():
    place = np.array([3.0, -2.0], np.float32)
    adam = Adam([place], longest=10.0)
    for _ in range(2000):
        adam.step([2 * (place - np.array([1.0, 5.0], np.float32))], rate=0.01)
    np.testing.assert_allclose(place, [1.0, 5.0], atol=1e-2)


def test_the_first_step_of_adam_is_as_long_as_its_rate():
    place = np.zeros(2, np.float32)
    Adam([place], longest=10.0).step([np.array([3.0, -0.01], np.float32)], rate=0.1)
    np.testing.assert_allclose(place, [-0.1, 0.1], rtol=1e-2)
