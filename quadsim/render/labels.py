"""Labels of pictures in the COCO format for key points (Lin et al. 2014).

The labels give the gates, their corners and the pose of the camera. Pixels are counted as in
quadsim.sensing.camera and in COCO: from the picture's top left corner. A key point is u, v and its
visibility: 0 not in the picture (u = v = 0), 1 in the picture but hidden by another gate's frame or
an obstacle, 2 visible.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict

import numpy as np

from quadsim.course import Course
from quadsim.course.frames import frames
from quadsim.render.poses import Pose
from quadsim.sensing.camera import Camera
from quadsim.sensing.visibility import hidden_corners

# Names of the opening's corners, viewed along the passage
CORNERS = ("right_bottom", "right_top", "left_bottom", "left_top")
CATEGORY = {
    "id": 1,
    "name": "gate",
    "keypoints": list(CORNERS),
    "skeleton": [[1, 2], [2, 4], [4, 3], [3, 1]],
}


def label(course: Course, camera: Camera, pose: Pose, segmentation: np.ndarray) -> dict:
    """Return the camera and the gates of one picture as JSON.

    Args:
        course: course of the scene.
        camera: camera on the vehicle.
        pose: pose of the vehicle.
        segmentation: gate numbers from 1 in each pixel  (height, width).
    """
    position, axes = camera.pose(pose.p, pose.q)
    return {
        "t": pose.t,
        "body": {"position": list(pose.p), "quaternion_wxyz": list(pose.q)},
        "camera": {"position": position.tolist(), "world_from_camera": axes.tolist()},
        "gates": list(_gates(course, camera, pose, segmentation)),
    }


def _gates(course: Course, camera: Camera, pose: Pose, segmentation: np.ndarray) -> Iterator[dict]:
    """Yield the label of every gate that has a corner or a pixel in the picture."""
    # each once, however often a lap leads through it
    gates = frames(course.gates)
    pixels, depth = camera.gate_corners(gates, pose.p, pose.q)
    eye, _ = camera.pose(pose.p, pose.q)
    behind = hidden_corners(gates, eye, course.obstacles)
    for k, gate in enumerate(gates):
        inside = camera.in_picture(pixels[k])
        number = course.gates.index(gate) + 1
        rows, columns = np.nonzero(segmentation == number)
        if not (inside.any() or len(rows)):
            continue
        visibility = np.where(inside, np.where(behind[k], 1, 2), 0)
        corners = np.where(inside[:, None], pixels[k], 0.0)
        yield {
            "gate": number,
            "keypoints": np.column_stack([corners, visibility]).ravel().tolist(),
            # depths of the corners along the optical axis [m]; negative: behind the camera
            "depth": depth[k].tolist(),
            "bbox": _box(rows, columns),
            "area": len(rows),
        }


def _box(rows: np.ndarray, columns: np.ndarray) -> list[int]:
    """Return x, y, width and height of the visible part of a frame [px]; zeros if hidden."""
    if not len(rows):
        return [0, 0, 0, 0]
    x = int(columns.min())
    y = int(rows.min())
    return [x, y, int(columns.max()) + 1 - x, int(rows.max()) + 1 - y]


def coco(course: Course, camera: Camera, labels: Iterable[dict]) -> dict:
    """Return all labels as one document.

    Args:
        course: course of all pictures.
        camera: camera of all pictures.
        labels: results of `label`, each with the `files` of its picture.
    """
    images: list[dict] = []
    annotations: list[dict] = []
    for i, one in enumerate(labels):
        files = {f"{kind}_file": path for kind, path in one["files"].items()}
        image = {
            "id": i,
            "file_name": files.pop("rgb_file"),
            **files,
            "width": camera.width,
            "height": camera.height,
            "t": one["t"],
            "body": one["body"],
            "camera": one["camera"],
        }
        images.append(image)
        for gate in one["gates"]:
            visibilities = gate["keypoints"][2::3]
            annotation = {
                "id": len(annotations),
                "image_id": i,
                "category_id": 1,
                "iscrowd": 0,
                "num_keypoints": sum(visibility > 0 for visibility in visibilities),
            }
            annotations.append(annotation | gate)
    info = {"course": course.name, "camera": asdict(camera), "gates": _gates_of(course)}
    return {"info": info, "categories": [CATEGORY], "images": images, "annotations": annotations}


def _gates_of(course: Course) -> list[dict]:
    """Return each gate's number, and the corners of its opening in the world [m].

    Corners are in the order of the key points.
    """
    found: list[dict] = []
    for gate in frames(course.gates):
        number = course.gates.index(gate) + 1
        found.append({"gate": number, "corners": gate.corners().tolist()})
    return found
