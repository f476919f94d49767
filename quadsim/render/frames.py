"""Files of pictures and their labels; an interrupted process leaves no partial file.

rgb/000007.png            colour, 8 bits
segmentation/000007.png   8 bits: 0 sky, gate numbers from 1, 254 obstacles, 255 ground
depth/000007.npz          `depth`, float32, along the optical axis [m]; inf: sky
labels/000007.json        written last: it marks a complete picture
"""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from PIL import Image

from quadsim.course import Course, parse_course
from quadsim.files.arrays import npz_bytes, read_bytes
from quadsim.files.atomic import replace_file
from quadsim.render.labels import label
from quadsim.render.look import Look, drawn_look, plain_look
from quadsim.render.poses import Pose
from quadsim.sensing.camera import Camera
from quadsim.streams import look_streams

if TYPE_CHECKING:
    from quadsim.render.scene import Scene

# Largest label or record of settings that is read [bytes]
LARGEST_JSON = 20_000_000
SUFFIXES = {"rgb": "png", "segmentation": "png", "depth": "npz", "labels": "json"}
LABELS = "labels"


@dataclass(frozen=True)
class Pictures:
    """The settings that decide every picture of a folder, except its pose."""

    course_name: str
    course_text: str
    camera: Camera
    seed: int
    vary: tuple[str, ...]  # of look.VARIED
    poses: str  # origin of the poses: "drawn", or the digest of a run

    @property
    def course(self) -> Course:
        """The course in the pictures."""
        return parse_course(self.course_text, self.course_name)

    def look(self, i: int) -> Look:
        """Return the look of picture i: plain, or drawn from the seed and i."""
        if not self.vary:
            return plain_look()
        return drawn_look(look_streams(self.seed, i), self.vary)

    def settings(self) -> dict[str, Any]:
        """Return all settings as JSON."""
        return json.loads(json.dumps(asdict(self)))


def path_of(out: Path, kind: str, i: int) -> Path:
    """Return the path of a file of picture i; `kind` is a key of SUFFIXES."""
    return out / kind / f"{i:06d}.{SUFFIXES[kind]}"


def whole_label(out: Path, i: int) -> dict | None:
    """Return the label of picture i.

    Returns:
        The label; None if a file of the picture is missing or has another size than recorded.
    """
    try:
        label = json.loads(read_bytes(path_of(out, LABELS, i), "a label", LARGEST_JSON))
        for kind, name in label["files"].items():
            if (out / name).stat().st_size != label["bytes"][kind]:
                return None
    # a damaged label counts as missing
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return label


class Job(NamedTuple):
    """The pictures to be made by one call of `make_frames`."""

    pictures: Pictures
    out: Path
    poses: Sequence[tuple[int, Pose]]  # number and pose of each picture


def make_frames(job: Job) -> list[int]:
    """Make the pictures of a job, and return their numbers. Raises OSError."""
    for i, pose in job.poses:
        _make(job.pictures, job.out, i, pose)
    return [i for i, _ in job.poses]


@lru_cache(maxsize=1)
def _scene(course_name: str, course_text: str, camera: Camera) -> Scene:
    """Return this process's cached scene, because its set-up takes longer than a picture."""
    # imported here, as it loads the compiler
    from quadsim.render.scene import Scene

    return Scene(parse_course(course_text, course_name), camera)


def _make(pictures: Pictures, out: Path, i: int, pose: Pose) -> None:
    """Make one picture with its label. Raises OSError."""
    scene = _scene(pictures.course_name, pictures.course_text, pictures.camera)
    seen = scene.shoot(pose.p, pose.q, pictures.look(i))
    contents = {
        "rgb": _png(seen.rgb),
        "segmentation": _png(seen.segmentation),
        "depth": npz_bytes({"depth": seen.depth}, compressed=True),
    }
    for kind, content in contents.items():
        replace_file(path_of(out, kind, i), content)

    # the label comes last, as it marks a complete picture
    record = label(scene.course, pictures.camera, pose, seen.segmentation)
    record["files"] = {kind: path_of(Path(), kind, i).as_posix() for kind in contents}
    record["bytes"] = {kind: len(content) for kind, content in contents.items()}
    replace_file(path_of(out, LABELS, i), json.dumps(record).encode())


def _png(pixels: np.ndarray) -> bytes:
    """Return the content of a PNG file."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "png", compress_level=1)
    return buffer.getvalue()
