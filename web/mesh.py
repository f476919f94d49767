"""The quadrotor's shape."""

from __future__ import annotations

import numpy as np

BOX = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])  # (8, 3)
BOX_FACES = np.array(  # (12, 3)
    [
        *((0, 1, 3), (0, 3, 2), (4, 7, 5), (4, 6, 7), (0, 5, 1), (0, 4, 5)),
        *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
    ]
)


def quadrotor(span: float) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Meshes of an X frame: a body with its nose forward, and four rotor discs. vertices (n, 3), faces (m, 3)"""
    a, w = 0.5 * span / np.sqrt(2), 0.05 * span
    arms = [
        _prism((-a, -a), (a, a), w),
        _prism((-a, a), (a, -a), w),
        _prism((-0.1 * span, 0), (0.32 * span, 0), 2.2 * w),
    ]
    discs = [_disc((x, y, 1.2 * w), 0.26 * span) for x in (-a, a) for y in (-a, a)]
    return {"body": _joined(arms), "rotors": _joined(discs)}


def _prism(a: tuple, b: tuple, w: float) -> tuple[np.ndarray, np.ndarray]:
    """A bar of width w from a to b in the body's plane."""
    along = np.array([b[0] - a[0], b[1] - a[1], 0.0])
    length = np.linalg.norm(along)
    ex = along / length
    ey = np.array([-ex[1], ex[0], 0.0])
    turn = np.stack([ex, ey, (0.0, 0.0, 1.0)], axis=1)
    centre = np.array([(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, 0.0])
    return BOX * (length, 2 * w, 1.4 * w) @ turn.T + centre, BOX_FACES


def _disc(centre: tuple, radius: float, corners: int = 20) -> tuple[np.ndarray, np.ndarray]:
    angle = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(corners)], axis=1)
    faces = [(0, 1 + k, 1 + (k + 1) % corners) for k in range(corners)]
    return np.vstack([np.zeros(3), rim]) + centre, np.array(faces)


def _joined(parts: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    offsets = np.cumsum([0, *(len(v) for v, _ in parts[:-1])])
    faces = [f + offset for (_, f), offset in zip(parts, offsets, strict=True)]
    return np.vstack([v for v, _ in parts]).astype(np.float32), np.vstack(faces).astype(np.uint32)
