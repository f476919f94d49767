"""One picture with its labels as files, each whole or not at all; what is there already is not made
again.

rgb/000007.png            colour, 8 bits
segmentation/000007.png   8 bits: 0 sky, gate numbers from 1, 254 obstacles, 255 ground
depth/000007.npz          `depth`, float32, along the optical axis [m]; inf: sky
labels/000007.json        written last: with it the picture is whole
"""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from quadsim.course import Course, parse_course
from quadsim.files.atomic import replace_file
from quadsim.render.labels import label
from quadsim.render.look import Look, drawn_look, plain_look
from quadsim.render.poses import Pose
from quadsim.sensing.camera import Camera
from quadsim.streams import look_streams

SUFFIXES = {"rgb": "png", "segmentation": "png", "depth": "npz", "labels": "json"}
LABELS = "labels"


@dataclass(frozen=True)
class Pictures:
    """What decides every picture of a folder, apart from its pose."""

    course_name: str
    course_text: str
    camera: Camera
    seed: int
    vary: tuple[str, ...]  # of look.VARIED
    poses: str  # where they come from: "drawn", or the digest of a run

    @property
    def course(self) -> Course:
        return parse_course(self.course_text, self.course_name)

    def look(self, i: int) -> Look:
        """The look of picture i: the plain one, or one that depends on the seed and on i alone."""
        if not self.vary:
            return plain_look()
        return drawn_look(look_streams(self.seed, i), self.vary)

    def settings(self) -> dict[str, Any]:
        """As JSON holds it."""
        return json.loads(json.dumps(asdict(self)))


def path_of(out: Path, kind: str, i: int) -> Path:
    """kind: of SUFFIXES."""
    return out / kind / f"{i:06d}.{SUFFIXES[kind]}"


def whole_label(out: Path, i: int) -> dict | None:
    """The label of picture i, where all its files are there in the size in which they were
    written."""
    try:
        label = json.loads(path_of(out, LABELS, i).read_bytes())
        files = [(out / name, label["bytes"][kind]) for kind, name in label["files"].items()]
        return label if all(path.stat().st_size == size for path, size in files) else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def make_frames(job: tuple[Pictures, Path, Sequence[tuple[int, Pose]]]) -> list[int]:
    """Make these pictures, in any process; returns their numbers. Raises OSError."""
    pictures, out, poses = job
    for i, pose in poses:
        _make(pictures, out, i, pose)
    return [i for i, _ in poses]


@lru_cache(maxsize=1)
def _scene(course_name: str, course_text: str, camera: Camera) -> tuple[Course, Any]:
    """One for each process: it takes longer to set up than to draw."""
    from quadsim.render.scene import Scene  # which loads PyBullet

    course = parse_course(course_text, course_name)
    return course, Scene(course, camera)


def _make(pictures: Pictures, out: Path, i: int, pose: Pose) -> None:
    course, scene = _scene(pictures.course_name, pictures.course_text, pictures.camera)
    seen = scene.shoot(pose.p, pose.q, pictures.look(i))
    data = {
        "rgb": _png(seen.rgb),
        "segmentation": _png(seen.segmentation),
        "depth": _npz(seen.depth),
    }
    for kind, content in data.items():
        replace_file(path_of(out, kind, i), content)
    files = {kind: path_of(Path(), kind, i).as_posix() for kind in data}
    written = {"files": files, "bytes": {kind: len(content) for kind, content in data.items()}}
    text = json.dumps(label(course, pictures.camera, pose, seen.segmentation) | written)
    replace_file(path_of(out, LABELS, i), text.encode())


def _png(pixels: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "png", compress_level=1)
    return buffer.getvalue()


def _npz(depth: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, depth=depth)
    return buffer.getvalue()
