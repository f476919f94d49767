"""Build the graph of an ONNX file, node by node."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from quadsim.files.extras import imported

# version of the format's operators, and of its files
OPERATORS = 17
FILES = 9


class Value(NamedTuple):
    """An input or an output of a graph, an array of float32."""

    name: str
    shape: Sequence[int | str]  # a text names a size that the caller chooses


class Graph:
    """The nodes and the constants of a graph that is being built.

    Raises:
        ModuleNotFoundError: onnx is not installed.
    """

    def __init__(self) -> None:
        self._onnx: Any = imported("onnx", "onnx", "onnx")
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
        """Add a node with one output, and return its name.

        Args:
            operator: name of the operator in ONNX.
            inputs: names of its inputs.
            to: name of its output; None: a name of its own.
            how: attributes of the operator.
        """
        name = to or f"{operator.lower()}{len(self._nodes)}"
        self._nodes.append(self._onnx.helper.make_node(operator, list(inputs), [name], **how))
        return name

    def file(
        self, name: str, inputs: Sequence[Value], outputs: Sequence[Value], about: Mapping[str, str]
    ) -> bytes:
        """Return the content of the file.

        Args:
            name: name of the graph.
            inputs: inputs of the graph.
            outputs: outputs of the graph, which nodes have as theirs.
            about: metadata, texts by name.
        """
        helper = self._onnx.helper
        graph = helper.make_graph(
            self._nodes, name, self._infos(inputs), self._infos(outputs), self._numbers
        )
        model = helper.make_model(
            graph, opset_imports=[helper.make_opsetid("", OPERATORS)], producer_name="quadsim"
        )
        model.ir_version = FILES
        helper.set_model_props(model, dict(about))
        self._onnx.checker.check_model(model)
        return model.SerializeToString()

    def _infos(self, values: Sequence[Value]) -> list[Any]:
        """Return inputs or outputs in the form of the format."""
        number = self._onnx.TensorProto.FLOAT
        make = self._onnx.helper.make_tensor_value_info
        return [make(value.name, number, list(value.shape)) for value in values]
