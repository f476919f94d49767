"""Write a trained network as an ONNX file, with metadata on its training."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from torch import Tensor

from quadsim.files.extras import imported
from quadsim.learn.gate_network import WHITE, Block, Network
from quadsim.sensing.pixels.network import INPUT

# version of the format's operators, and of its files
OPERATORS = 17
FILES = 9


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
    onnx = imported("onnx", "onnx", "train")
    graph = Graph(onnx)
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
    return graph.file(about)


class Graph:
    """The nodes and the constants of a graph that is being built."""

    def __init__(self, onnx: Any):
        self._onnx = onnx
        self._nodes: list[Any] = []
        self._numbers: list[Any] = []

    def constant(self, value: np.ndarray) -> str:
        """Add an array, and return its name."""
        name = f"c{len(self._numbers)}"
        self._numbers.append(self._onnx.numpy_helper.from_array(value, name))
        return name

    def nodes(self, operator: str, outputs: int, *inputs: str, **how: Any) -> list[str]:
        """Add a node, and return the names of its outputs."""
        names = [f"{operator.lower()}{len(self._nodes)}_{k}" for k in range(outputs)]
        self._nodes.append(self._onnx.helper.make_node(operator, list(inputs), names, **how))
        return names

    def node(self, operator: str, *inputs: str, to: str | None = None, **how: Any) -> str:
        """Add a node with one output, and return its name."""
        name = to or f"{operator.lower()}{len(self._nodes)}"
        self._nodes.append(self._onnx.helper.make_node(operator, list(inputs), [name], **how))
        return name

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

    def file(self, about: Mapping[str, str]) -> bytes:
        """Return the content of the file."""
        helper = self._onnx.helper
        number = self._onnx.TensorProto.FLOAT
        picture = helper.make_tensor_value_info(INPUT, number, [1, 3, "height", "width"])
        found = helper.make_tensor_value_info("found", number, [1, 5, "rows", "columns"])
        graph = helper.make_graph(self._nodes, "gates", [picture], [found], self._numbers)
        model = helper.make_model(
            graph, opset_imports=[helper.make_opsetid("", OPERATORS)], producer_name="quadsim"
        )
        model.ir_version = FILES
        helper.set_model_props(model, dict(about))
        self._onnx.checker.check_model(model)
        return model.SerializeToString()
