"""The network that finds corners of gates in a picture without an estimate.

The picture is reduced to a width of WIDTH pixels. For each cell of STRIDE by STRIDE reduced pixels
the network returns the probability that it contains a corner of a gate's opening, the corner's
position in the cell, and the vector from the corner to the centre of the gate ("objects as points",
Zhou et al. 2019; AlphaPilot, Foehn et al. 2022, finds the corners of a gate by a similar field).
Corners that point to the same centre belong to one gate. The four corners of a square gate look
alike, so the network does not distinguish them; the direction from the centre does, if the attitude
is estimated.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from quadsim.files.extras import imported
from quadsim.files.strict_yaml import FileError

# The network that comes with the project, by its name
GATES = "gates"
NETWORK = Path(__file__).parent / "gates.onnx"
EXPECTED = "expected a network of race train-pixels"
# name of a network's input
INPUT = "picture"
# width of a reduced picture, and edge of a cell [px]
WIDTH = 320
STRIDE = 4
# Both sizes of the network's input are multiples of it: its coarsest cells.
COARSEST = 32
# [cells] unit of the vector to the centre
FAR = 10.0
# least probability of a corner
LIKELY = 0.3
# [cells] largest distance of the places of a corner that two cells tell, if they agree
AGREE = 1.0
# largest distance of the centres to which two corners of a gate point: by the smaller of their
# distances from it, and beside that [px]
SAME_CENTRE = 0.7
SLACK = 8.0
# least angle between the directions of two corners of a gate, its cosine
APART = 0.9


class FoundGate(NamedTuple):
    """A gate in a picture."""

    # centre to which its corners point [px]  (2,)
    centre: np.ndarray
    # its corners, one to four [px]  (n, 2)
    corners: np.ndarray
    # probability of each  (n,)
    likely: np.ndarray


class GateNetwork:
    """A trained network.

    Args:
        path: path of the ONNX file.

    Raises:
        FileError: the file is not a network of this kind.
        ModuleNotFoundError: onnxruntime is not installed.
    """

    def __init__(self, path: Path = NETWORK):
        runtime = imported("onnxruntime", "onnxruntime", "pixels")
        options = runtime.SessionOptions()
        # One thread: the others plan, and the sums have the same order everywhere.
        options.intra_op_num_threads = 1
        options.inter_op_num_threads = 1
        try:
            self._session = runtime.InferenceSession(
                str(path), options, providers=["CPUExecutionProvider"]
            )
        except Exception:  # onnxruntime has a class of its own for each way to be damaged
            raise FileError(
                f"{path}: {EXPECTED}, got a file that onnxruntime cannot read"
            ) from None
        if [one.name for one in self._session.get_inputs()] != [INPUT]:
            raise FileError(f"{path}: {EXPECTED}, got a network with other inputs")
        # metadata on its training
        self.about: dict[str, str] = dict(self._session.get_modelmeta().custom_metadata_map)

    def __call__(self, rgb: np.ndarray) -> list[FoundGate]:
        """Return the gates found in a picture, in pixels of this picture.

        Args:
            rgb: the picture  (height, width, 3) uint8.
        """
        small, scale = reduced(rgb)
        (output,) = self._session.run(None, {INPUT: network_input(small)})
        corners = corners_of(output[0])
        return grouped(corners._replace(pixel=corners.pixel / scale, centre=corners.centre / scale))


class Likely(NamedTuple):
    """The corners that a network finds likely, most likely first."""

    pixel: np.ndarray  # [px]  (n, 2)
    centre: np.ndarray  # of the gate [px]  (n, 2)
    likely: np.ndarray  # (n,)


@cache
def load_network(name: str) -> GateNetwork:
    """Return a network by its name, GATES, or by its file's path; each file is loaded once.

    Raises:
        FileError: there is no such file, or it is not a network of this kind.
        ModuleNotFoundError: onnxruntime is not installed.
    """
    path = NETWORK if name == GATES else Path(name)
    if not path.is_file():
        raise FileError(f"expected {GATES}, or a FILE.onnx that is there, got {name!r}")
    return GateNetwork(path)


def reduced(rgb: np.ndarray) -> tuple[np.ndarray, float]:
    """Return a picture reduced to a width of WIDTH, and the factor of the reduction.

    Args:
        rgb: the picture  (height, width, 3) uint8.
    """
    height, width = rgb.shape[:2]
    scale = WIDTH / width
    size = (WIDTH, round(scale * height))
    if size == (width, height):
        return rgb, 1.0
    return np.asarray(Image.fromarray(rgb).resize(size, Image.Resampling.BOX)), scale


def network_input(small: np.ndarray) -> np.ndarray:
    """Return a reduced picture as the input of the network.

    Args:
        small: the reduced picture  (height, WIDTH, 3) uint8.

    Returns:
        The input  (1, 3, height, WIDTH) float32, with black rows added below so that COARSEST
        divides the height.
    """
    height = -(-len(small) // COARSEST) * COARSEST
    full = np.zeros((1, 3, height, WIDTH), np.float32)
    full[0, :, : len(small)] = small.transpose(2, 0, 1)
    return full


def corners_of(output: np.ndarray) -> Likely:
    """Return the corners in an output of the network, in pixels of the reduced picture.

    Args:
        output: for each cell, the probability of a corner, the vector from the middle of the cell
            to the corner [cells], and the vector from the corner to the gate's centre [FAR
            cells]  (5, rows, columns).
    """
    heat = output[0]
    # A corner is a cell that is the likeliest among its neighbours.
    padded = np.pad(heat, 1)
    rows, columns = heat.shape
    around = [padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)]
    peak = (heat >= np.max(around, axis=0)) & (heat > LIKELY)
    row, column = np.nonzero(peak)
    order = np.argsort(-heat[row, column], kind="stable")
    row, column = row[order], column[order]
    at = np.column_stack([column, row]) + 0.5 + output[1:3, row, column].T
    total = np.zeros((len(row), 4))
    weight = np.zeros(len(row))
    # The cells around a corner estimate its position, too; those that agree are averaged.
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            r = np.clip(row + down, 0, rows - 1)
            c = np.clip(column + right, 0, columns - 1)
            told = np.column_stack([c, r]) + 0.5 + output[1:3, r, c].T
            agrees = np.linalg.norm(told - at, axis=1) < AGREE
            w = np.where(agrees, heat[r, c], 0.0)
            centre = told + FAR * output[3:5, r, c].T
            total += w[:, None] * np.column_stack([told, centre])
            weight += w
    mean = STRIDE * total / np.maximum(weight, 1e-9)[:, None]
    return Likely(mean[:, :2], mean[:, 2:], heat[row, column])


def grouped(corners: Likely) -> list[FoundGate]:
    """Return the gates that corners form."""
    left = list(range(len(corners.pixel)))
    found = []
    while left:
        # The likeliest corner, and those that point nearest to its centre from other directions.
        first = left[0]
        apart = np.linalg.norm(corners.centre - corners.centre[first], axis=1)
        members = [first]
        for k in sorted(left[1:], key=lambda k: float(apart[k])):
            if len(members) < 4 and _belongs(corners, members, k):
                members.append(k)
        left = [k for k in left if k not in members]
        centre = corners.centre[members].mean(axis=0)
        found.append(FoundGate(centre, corners.pixel[members], corners.likely[members]))
    return found


def _belongs(corners: Likely, members: list[int], k: int) -> bool:
    """Return whether corner k may belong to the same gate as other corners."""
    away = corners.pixel[k] - corners.centre[k]
    length = float(np.linalg.norm(away)) + 1e-9
    for m in members:
        other = corners.pixel[m] - corners.centre[m]
        size = float(np.linalg.norm(other)) + 1e-9
        apart = np.linalg.norm(corners.centre[k] - corners.centre[m])
        if apart > SAME_CENTRE * min(length, size) + SLACK:
            return False
        if away @ other > APART * length * size:
            return False
    return True
