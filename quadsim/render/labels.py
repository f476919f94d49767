"""Labels of a picture, as COCO has them for key points (Lin et al. 2014): gates, their corners, the
camera's pose.

Pixels are those of quadsim.sensing.camera, as COCO's: from the picture's top left corner. A key
point is u, v and its
visibility: 0 not in the picture (u = v = 0), 1 in it but behind another gate's frame or an
obstacle, 2 seen.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict

import numpy as np

from quadsim.course import Course
from quadsim.render.poses import Pose
from quadsim.sensing.camera import Camera
from quadsim.sensing.visibility import hidden_corners

# of the opening, seen along the passage
CORNERS = ("right_bottom", "right_top", "left_bottom", "left_top")
CATEGORY = {
    "id": 1,
    "name": "gate",
    "keypoints": list(CORNERS),
    "skeleton": [[1, 2], [2, 4], [4, 3], [3, 1]],
}


def label(course: Course, camera: Camera, pose: Pose, segmentation: np.ndarray) -> dict:
    """The camera and the gates of one picture, as JSON. segmentation: (height, width), gate numbers
    from 1."""
    position, axes = camera.pose(pose.p, pose.q)
    return {
        "t": pose.t,
        "body": {"position": list(pose.p), "quaternion_wxyz": list(pose.q)},
        "camera": {"position": position.tolist(), "world_from_camera": axes.tolist()},
        "gates": list(_gates(course, camera, pose, segmentation)),
    }


def _gates(course: Course, camera: Camera, pose: Pose, segmentation: np.ndarray) -> Iterator[dict]:
    """Of every gate of which a corner or a pixel is in the picture."""
    gates = tuple(dict.fromkeys(course.gates))
    pixels, depth = camera.gate_corners(gates, pose.p, pose.q)
    behind = hidden_corners(gates, camera.pose(pose.p, pose.q)[0], course.obstacles)
    for k, gate in enumerate(gates):
        inside = camera.in_picture(pixels[k])
        number = course.gates.index(gate) + 1
        rows, columns = np.nonzero(segmentation == number)
        if not (inside.any() or len(rows)):
            continue
        seen = np.where(inside, np.where(behind[k], 1, 2), 0)
        corners = np.where(inside[:, None], pixels[k], 0.0)
        yield {
            "gate": number,
            "keypoints": np.column_stack([corners, seen]).ravel().tolist(),
            # of the corners, along the optical axis [m]; negative: behind the camera
            "depth": depth[k].tolist(),
            "bbox": _box(rows, columns),
            "area": len(rows),
        }


def _box(rows: np.ndarray, columns: np.ndarray) -> list[int]:
    """x, y, width, height of what is seen of the frame [px]; zeros where nothing is."""
    if not len(rows):
        return [0, 0, 0, 0]
    x, y = int(columns.min()), int(rows.min())
    return [x, y, int(columns.max()) + 1 - x, int(rows.max()) + 1 - y]


def coco(course: Course, camera: Camera, labels: Iterable[dict]) -> dict:
    """All labels as one document; `labels`: of `label`, with `name` and `files` of the picture."""
    images, annotations = [], []
    for i, one in enumerate(labels):
        size = {"width": camera.width, "height": camera.height}
        files = {f"{kind}_file": path for kind, path in one["files"].items()}
        images.append({"id": i, "file_name": files.pop("rgb_file"), **files, **size})
        images[-1] |= {key: one[key] for key in ("t", "body", "camera")}
        for gate in one["gates"]:
            counted = sum(v > 0 for v in gate["keypoints"][2::3])
            kept = {
                "id": len(annotations),
                "image_id": i,
                "category_id": 1,
                "iscrowd": 0,
                "num_keypoints": counted,
            }
            annotations.append(kept | gate)
    info = {
        "course": course.name,
        "camera": asdict(camera),
        "gates": [_where(course, k) for k in _numbers(course)],
    }
    return {"info": info, "categories": [CATEGORY], "images": images, "annotations": annotations}


def _numbers(course: Course) -> list[int]:
    return [course.gates.index(gate) for gate in dict.fromkeys(course.gates)]


def _where(course: Course, k: int) -> dict:
    """The corners of a gate's opening in the world [m], in the order of the key points."""
    return {"gate": k + 1, "corners": course.gates[k].corners().tolist()}
