"""The targets of the network that finds gates, and its file."""

import numpy as np
import pytest

from quadsim.sensing.pixels.network import WIDTH, corners_of, grouped, network_input

torch = pytest.importorskip("torch", reason="PyTorch is not installed")

from quadsim.learn.gate_network import Network, targets  # noqa: E402

# corners of two gates: right and down, those of the centre [px], whether they are a task
CORNERS = [
    *((100.0 + a * 40.3, 80.0 + b * 33.1, 100.0, 80.0, 1.0) for a in (-1, 1) for b in (-1, 1)),
    *((250.0 + a * 20.2, 50.0 + b * 21.7, 250.0, 50.0, 1.0) for a in (-1, 1) for b in (-1, 1)),
]


def padded(rows):
    corners = np.full((1, 64, 5), np.nan, np.float32)
    corners[0, : len(rows)] = rows
    return corners


def test_targets_are_read_as_the_corners_that_they_were_made_of():
    wanted = targets(padded(CORNERS), (48, 80))
    output = np.concatenate([wanted.heat.numpy(), wanted.vectors.numpy()[0]])
    found = grouped(corners_of(output))
    assert [len(one.corners) for one in found] == [4, 4]
    at = np.concatenate([one.corners for one in found])
    apart = np.linalg.norm(at[:, None] - np.array(CORNERS)[:, :2], axis=2)
    assert apart.min(axis=1).max() < 0.01
    assert sorted(one.centre.round(2).tolist() for one in found) == [[100.0, 80.0], [250.0, 50.0]]


def test_a_corner_that_is_no_task_teaches_nothing():
    rows = [(*row[:4], 0.0) for row in CORNERS]
    wanted = targets(padded(rows), (48, 80))
    assert float(wanted.heat.max()) == 0.0
    assert float(wanted.near.max()) == 0.0
    assert float(wanted.weight[0, 11, 14]) == 0.0
    assert float(wanted.weight[0, 40, 40]) == 1.0


def test_the_file_of_a_network_gives_what_the_network_gives(tmp_path):
    pytest.importorskip("onnx", reason="onnx is not installed")
    runtime = pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
    from quadsim.learn.onnx_file import onnx_bytes

    torch.manual_seed(0)
    network = Network()
    picture = network_input(np.random.default_rng(0).integers(0, 256, (60, WIDTH, 3)))
    with torch.no_grad():
        # The normalisation has seen pictures.
        network.train()(torch.from_numpy(picture))
        mine = network.eval()(torch.from_numpy(picture)).numpy()
    mine[:, 0] = 1.0 / (1.0 + np.exp(-mine[:, 0]))
    session = runtime.InferenceSession(onnx_bytes(network, {"seed": "0"}))
    (found,) = session.run(None, {"picture": picture})
    assert np.allclose(found, mine, atol=1e-4)
    assert session.get_modelmeta().custom_metadata_map["seed"] == "0"
