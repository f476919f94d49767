"""Write a trained network as an ONNX file, with metadata on its training."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor

from quadsim.files.onnx_graph import Graph, Value
from quadsim.learn.gate_network import WHITE, Block, Network
from quadsim.sensing.pixels.network import INPUT


def onnx_bytes(network: Network, about: Mapping[str, str]) -> bytes:
    """Return the content of an ONNX file.

    Its input is `picture`  (1, 3, height, width) float32, colours from 0 to 255, with height and
    width divisible by 32. Its output is the network's, with probabilities instead of logits.

    Args:
        network: a network in evaluation mode.
        about: metadata on the training.

    Raises:
        ModuleNotFoundError: onnx is not installed.
    """
    graph = NetworkGraph()
    x = graph.node("Mul", INPUT, graph.constant(np.array(1.0 / WHITE, np.float32)))
    x = graph.block(graph.node("Sub", x, graph.constant(np.array(0.5, np.float32))), network.first)
    layers = []
    for part in network.down:
        assert isinstance(part, torch.nn.Sequential)
        for block in part:
            x = graph.block(x, block)
        layers.append(x)
    twice = graph.constant(np.array([1.0, 1.0, 2.0, 2.0], np.float32))
    for narrow, up, finer in zip(network.narrow, network.up, reversed(layers[:-1]), strict=True):
        coarse = graph.node(
            "Resize",
            graph.block(x, narrow),
            "",
            twice,
            mode="nearest",
            coordinate_transformation_mode="asymmetric",
            nearest_mode="floor",
        )
        x = graph.block(graph.node("Add", coarse, finer), up)
    x = graph.block(x, network.head)
    output = network.output
    assert output.bias is not None
    x = graph.convolution(x, output.weight, output.bias, stride=1)
    split = graph.constant(np.array([1, len(output.bias) - 1], np.int64))
    logit, vectors = graph.nodes("Split", 2, x, split, axis=1)
    graph.node("Concat", graph.node("Sigmoid", logit), vectors, axis=1, to="found")
    picture = Value(INPUT, (1, 3, "height", "width"))
    found = Value("found", (1, 5, "rows", "columns"))
    return graph.file("gates", [picture], [found], about)


class NetworkGraph(Graph):
    """The graph of a network of convolutions."""

    def convolution(self, x: str, weight: Tensor, bias: Tensor, stride: int) -> str:
        """Add a convolution, and return the name of its output."""
        size = weight.shape[-1]
        arrays = [
            self.constant(part.detach().float().contiguous().numpy()) for part in (weight, bias)
        ]
        return self.node(
            "Conv",
            x,
            *arrays,
            kernel_shape=[size, size],
            strides=[stride, stride],
            pads=[size // 2] * 4,
        )

    def block(self, x: str, block: torch.nn.Module) -> str:
        """Add a convolution with folded normalisation and a rectifier; return its output's name."""
        assert isinstance(block, Block)
        convolution, normal, _ = block
        assert isinstance(convolution, torch.nn.Conv2d)
        assert isinstance(normal, torch.nn.BatchNorm2d)
        assert normal.running_var is not None
        assert normal.running_mean is not None
        scale = normal.weight / torch.sqrt(normal.running_var + normal.eps)
        weight = convolution.weight * scale[:, None, None, None]
        bias = normal.bias - normal.running_mean * scale
        return self.node("Relu", self.convolution(x, weight, bias, convolution.stride[0]))
