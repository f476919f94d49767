"""The layers, the losses and the training of the network that finds gates in pictures.

The network is trained by PyTorch, written by `quadsim.learn.onnx_file`, and used by
`quadsim.sensing.pixels.network`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import cos, pi
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from quadsim.learn.gate_pictures import GatePictures
from quadsim.sensing.pixels.network import COARSEST, FAR, STRIDE
from quadsim.streams import batch_stream

# channels at strides 2, 4, 8, 16 and 32, and of the layer before the output
CHANNELS = (8, 16, 32, 48, 64)
HEAD = 24
# probability of a corner, its position in the cell, and the vector to its gate's centre
OUTPUTS = 5
# numbers of a picture are divided by it
WHITE = 255.0
# probability of a corner in any cell before training
RARE = 0.005
# focal loss: exponents of the error, and of the distance from a corner (Law and Deng 2018)
FOCUS = 2.0
AROUND = 4
# standard deviation of a corner's heat, in cells; cells within NEAR of it learn its place
SPREAD = 0.8
NEAR = 1.5
# [cells] added to the size of a gate, by which errors of its centre are divided
LEAST = 2.0
# weights of the losses of place and centre
PLACE = 1.0
CENTRE = 1.0
# height and width of a part of a picture [px], and share of the steps with whole pictures
PART = (96, 160)
WHOLE = 0.5
# share of the steps in which the learning rate rises, to `rate`; then it falls as a cosine
WARM_UP = 0.05


@dataclass(frozen=True)
class NetworkTraining:
    """The settings of a network's training."""

    steps: int = 6000
    # number of cropped pictures in a batch; a batch of whole pictures has half as many
    batch: int = 16
    # largest learning rate
    rate: float = 4e-3
    weight_decay: float = 1e-4
    # whether products are taken in bfloat16, which takes half the time on processors that have it
    bfloat16: bool = True


class Losses(NamedTuple):
    """The terms of the loss."""

    heat: Tensor
    place: Tensor
    centre: Tensor


class Block(nn.Sequential):
    """A convolution with batch normalisation and rectifier."""

    def __init__(self, inputs: int, outputs: int, size: int = 3, stride: int = 1):
        convolution = nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False)
        super().__init__(convolution, nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


class Network(nn.Module):
    """An encoder, and a decoder that adds the encoder's layers (Lin et al. 2017).

    The layers are in the order in which `quadsim.learn.onnx_file` writes them.
    """

    def __init__(self) -> None:
        super().__init__()
        first, *coarser = CHANNELS
        self.first = Block(3, first, stride=2)
        inputs = (first, *coarser[:-1])
        self.down = nn.ModuleList(
            nn.Sequential(Block(a, b, stride=2), Block(b, b))
            for a, b in zip(inputs, coarser, strict=True)
        )
        finer = list(reversed(coarser))
        pairs = list(pairwise(finer))
        self.narrow = nn.ModuleList(Block(a, b, size=1) for a, b in pairs)
        self.up = nn.ModuleList(Block(b, b) for _, b in pairs)
        self.head = Block(coarser[0], HEAD)
        self.output = nn.Conv2d(HEAD, OUTPUTS, 1)
        with torch.no_grad():
            bias = self.output.bias
            assert bias is not None
            bias.zero_()
            bias[0] = float(np.log(RARE / (1.0 - RARE)))

    def forward(self, picture: Tensor) -> Tensor:
        """Return the outputs of each cell, with the logit of the probability first.

        Args:
            picture: colours from 0 to 255  (n, 3, height, width).

        Returns:
            The outputs  (n, OUTPUTS, height / STRIDE, width / STRIDE).
        """
        x = self.first(picture / WHITE - 0.5)
        layers = []
        for part in self.down:
            x = part(x)
            layers.append(x)
        for narrow, up, finer in zip(self.narrow, self.up, reversed(layers[:-1]), strict=True):
            x = up(functional.interpolate(narrow(x), scale_factor=2.0) + finer)
        # The places need more digits than a product in bfloat16 has.
        with torch.autocast("cpu", enabled=False):
            return self.output(self.head(x.float()))


class Targets(NamedTuple):
    """The outputs that a network should have for a batch."""

    # 1 at a corner, less around it  (n, rows, columns)
    heat: Tensor
    # weight of each cell's heat; 0 if its corner is not to be found  (n, rows, columns)
    weight: Tensor
    # place and centre  (n, 4, rows, columns); size of the gate [cells]; which cells learn them
    vectors: Tensor
    size: Tensor
    near: Tensor


class Batch(NamedTuple):
    """Pictures with their targets."""

    picture: Tensor
    targets: Targets


def batches(pictures: GatePictures, size: int, steps: int, seed: int) -> Iterator[Batch]:
    """Yield batches of parts of pictures around a corner, and sometimes of whole pictures.

    A part takes a quarter of a picture's time, and has most of its corners. Gates that fill a
    picture are learnt from whole pictures, of which a batch has half as many. Each picture is used
    once before any is used again; some are mirrored, and the colours of all are changed.
    """
    rng = np.random.default_rng(batch_stream(seed))
    count, height, width = pictures.rgb.shape[:3]
    order = np.zeros(0, int)
    for _ in range(steps):
        whole = rng.random() < WHOLE
        number = -(-size // 2) if whole else size
        if len(order) < number:
            order = np.concatenate([order, rng.permutation(count)])
        chosen, order = order[:number], order[number:]
        shape = (height, width) if whole else PART
        rgb = np.zeros((number, *shape, 3), np.float32)
        corners = pictures.corners[chosen].copy()
        for k, one in enumerate(chosen.tolist()):
            left, top = (0, 0) if whole else _part(corners[k], (height, width), rng)
            rgb[k] = pictures.rgb[one, top : top + shape[0], left : left + shape[1]]
            corners[k, :, :4] -= (left, top, left, top)
        mirrored = rng.random(number) < 0.5
        rgb[mirrored] = rgb[mirrored, :, ::-1]
        corners[mirrored, :, 0:4:2] = shape[1] - corners[mirrored, :, 0:4:2]
        # brightness of each colour, and contrast
        rgb *= rng.uniform(0.85, 1.15, (number, 1, 1, 3)).astype(np.float32)
        rgb += rng.uniform(-15.0, 15.0, (number, 1, 1, 1)).astype(np.float32)
        np.clip(rgb, 0.0, WHITE, out=rgb)
        full = -(-shape[0] // COARSEST) * COARSEST
        picture = np.zeros((number, 3, full, shape[1]), np.float32)
        picture[:, :, : shape[0]] = rgb.transpose(0, 3, 1, 2)
        cells = (full // STRIDE, shape[1] // STRIDE)
        yield Batch(torch.from_numpy(picture), targets(corners, cells))


def _part(corners: np.ndarray, shape: tuple[int, int], rng: np.random.Generator) -> tuple[int, int]:
    """Return the left and upper border of a random part of a picture, with a corner if possible.

    Args:
        corners: rows of `quadsim.learn.gate_pictures.Corner`  (corners, 5).
        shape: height and width of the picture [px].
        rng: random number generator.
    """
    most = np.array([shape[1] - PART[1], shape[0] - PART[0]])
    tasks = np.flatnonzero(corners[:, 4] == 1.0)
    if not len(tasks):
        left, top = (rng.random(2) * (most + 1)).astype(int).tolist()
        return left, top
    at = corners[rng.choice(tasks), :2]
    away = rng.random(2) * (PART[1], PART[0])
    left, top = np.clip(at - away, 0, most).astype(int).tolist()
    return left, top


def targets(corners: np.ndarray, shape: tuple[int, int]) -> Targets:
    """Return the desired outputs for corners.

    Args:
        corners: rows of `quadsim.learn.gate_pictures.Corner`  (n, corners, 5).
        shape: rows and columns of cells.
    """
    n = len(corners)
    heat = np.zeros((n, *shape), np.float32)
    weight = np.ones((n, *shape), np.float32)
    vectors = np.zeros((n, 4, *shape), np.float32)
    size = np.ones((n, *shape), np.float32)
    nearest = np.full((n, *shape), np.inf, np.float32)
    for i, j in zip(*np.nonzero(~np.isnan(corners[:, :, 4])), strict=True):
        u, v, cu, cv, task = corners[i, j].tolist()
        x, y = u / STRIDE, v / STRIDE
        # Parts of pictures leave corners out.
        if not (0.0 <= x < shape[1] and 0.0 <= y < shape[0]):
            continue
        # cells around the corner
        left, right = max(int(x) - 2, 0), min(int(x) + 3, shape[1])
        top, bottom = max(int(y) - 2, 0), min(int(y) + 3, shape[0])
        dx = x - (np.arange(left, right) + 0.5)
        dy = y - (np.arange(top, bottom) + 0.5)
        square = dx**2 + dy[:, None] ** 2
        window = (i, slice(top, bottom), slice(left, right))
        if not task:
            weight[window] = 0.0
            continue
        heat[window] = np.maximum(heat[window], np.exp(-square / (2.0 * SPREAD**2)))
        heat[i, int(y), int(x)] = 1.0
        closer = square < nearest[window]
        nearest[window][closer] = square[closer]
        away = np.array([cu - u, cv - v]) / STRIDE
        size[window][closer] = np.hypot(*away)
        where = np.broadcast_to(dx, square.shape), np.broadcast_to(dy[:, None], square.shape)
        for k, value in enumerate((*where, away[0] / FAR, away[1] / FAR)):
            part = vectors[i, k, top:bottom, left:right]
            part[closer] = value[closer] if k < 2 else value
    near = (nearest < NEAR**2).astype(np.float32)
    # A corner that is to be found counts even if another one near it is not.
    weight = np.maximum(weight, heat)
    return Targets(*map(torch.from_numpy, (heat, weight, vectors, size, near)))


def losses(output: Tensor, wanted: Targets) -> Losses:
    """Return the losses of a batch, divided by its number of corners."""
    logit = output[:, 0]
    heat = wanted.heat
    corner = heat == 1.0
    count = corner.sum().clamp(min=1)
    likely = torch.sigmoid(logit)
    hit = (1.0 - likely) ** FOCUS * functional.logsigmoid(logit)
    miss = (1.0 - heat) ** AROUND * likely**FOCUS * functional.logsigmoid(-logit)
    of_heat = -(torch.where(corner, hit, miss) * wanted.weight).sum() / count
    near = wanted.near / wanted.near.sum().clamp(min=1)
    off = (output[:, 1:] - wanted.vectors).abs()
    of_place = (off[:, :2].sum(1) * near).sum()
    of_centre = (FAR * off[:, 2:].sum(1) / (wanted.size + LEAST) * near).sum()
    return Losses(of_heat, of_place, of_centre)


def trained(
    pictures: GatePictures,
    numbers: NetworkTraining,
    seed: int,
    report: Callable[[Network, int, tuple[float, float, float]], None],
) -> Network:
    """Return a network that is trained on pictures.

    Args:
        pictures: the pictures.
        numbers: steps, batches, learning rate.
        seed: seed of weights and batches; equal seeds give equal networks on one machine.
        report: function that is called a hundred times, with the network, the steps so far and
            the mean losses since the last call.
    """
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    network = Network().to(memory_format=torch.channels_last)
    optimiser = torch.optim.AdamW(
        network.parameters(), numbers.rate, weight_decay=numbers.weight_decay, fused=True
    )
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda k: _rate(k / numbers.steps))
    network.train()
    sums = np.zeros(3)
    every = max(numbers.steps // 100, 1)
    for step, batch in enumerate(batches(pictures, numbers.batch, numbers.steps, seed), start=1):
        picture = batch.picture.contiguous(memory_format=torch.channels_last)
        with torch.autocast("cpu", torch.bfloat16, enabled=numbers.bfloat16):
            output = network(picture)
        parts = losses(output, batch.targets)
        loss = parts.heat + PLACE * parts.place + CENTRE * parts.centre
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 10.0)
        optimiser.step()
        schedule.step()
        sums += [part.item() for part in parts]
        if step % every == 0:
            mean = sums / every
            network.eval()
            report(network, step, (float(mean[0]), float(mean[1]), float(mean[2])))
            network.train()
            sums[:] = 0.0
    return network.eval()


def _rate(share: float) -> float:
    """Return the learning rate at a share of the training, divided by its largest value."""
    if share < WARM_UP:
        return 0.05 + 0.95 * share / WARM_UP
    return 0.005 + 0.995 * 0.5 * (1.0 + cos(pi * (share - WARM_UP) / (1.0 - WARM_UP)))
