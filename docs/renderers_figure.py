"""Ten scenes beside TinyRenderer's, for pictures.md: `.venv/bin/python docs/renderers_figure.py`.

It prints the share of pixels in which both see the same, how far their depths differ, and how long
the rasteriser takes.
"""

from __future__ import annotations

from dataclasses import replace
from time import process_time

import numpy as np
from PIL import Image
from shared import DOCS
from tiny_renderer import Scene as TinyScene

from quadsim.course import load_course
from quadsim.render.look import plain_look
from quadsim.render.poses import drawn_poses
from quadsim.render.scene import Scene, Views
from quadsim.sensing.camera import Camera, load_camera

CAMERA = load_camera("aigp")
# course, and numbers of the poses
SHOWN = (("split_s_swift", (0, 1, 3, 4, 5)), ("lsy_level2", (0, 1, 2)), ("alphapilot", (0, 3)))
COLUMNS = 5
SMALLER = 3
FAR = 50.0  # depths are compared up to there [m]
TIMED = 40  # pictures whose time is measured, each REPEATED times
REPEATED = 5


def main() -> None:
    pairs = []
    same = []
    off = []
    for name, numbers in SHOWN:
        course = load_course(name)
        poses = drawn_poses(course, CAMERA, max(numbers) + 1, seed=5)
        scene = Scene(course, CAMERA)
        tiny = TinyScene(course, CAMERA)
        for k in numbers:
            ours = scene.shoot(poses[k].p, poses[k].q, plain_look())
            theirs = tiny.shoot(poses[k].p, poses[k].q, plain_look())
            agree = ours.segmentation == theirs.segmentation
            both = agree & (ours.depth < FAR)
            same.append(agree.mean())
            off.append(abs(ours.depth[both] - theirs.depth[both]))
            pairs.append(np.vstack([ours.rgb, theirs.rgb]))
        tiny.close()
    rows = [np.hstack(pairs[i : i + COLUMNS]) for i in range(0, len(pairs), COLUMNS)]
    sheet = Image.fromarray(np.vstack(rows))
    sheet = sheet.resize((sheet.width // SMALLER, sheet.height // SMALLER), Image.Resampling.BOX)
    sheet.save(DOCS / "renderers.png")
    depths = np.concatenate(off)
    print(f"same in {100 * np.mean(same):.2f} % of the pixels, least {100 * min(same):.2f} %")
    print(f"depths differ by {1e3 * np.median(depths):.2f} mm in the median")

    lens = replace(CAMERA, k1=-0.15, k2=0.02)
    times = [milliseconds(CAMERA, 1), milliseconds(CAMERA, 4), milliseconds(lens, 1)]
    one, four, bent = times
    print(
        f"processor time: one pass {one:.1f} ms, four {four:.1f} ms, one through a lens {bent:.1f}"
    )


def milliseconds(camera: Camera, passes: int) -> float:
    """Return the processor time of a picture of split_s_swift, in the median of TIMED [ms]."""
    course = load_course("split_s_swift")
    scene = Scene(course, camera)
    look = plain_look()
    least = []
    for pose in drawn_poses(course, camera, TIMED, seed=3):
        position, axes = camera.pose(pose.p, pose.q)
        views = Views(
            np.tile(position, (passes, scene.rows, 1)), np.tile(axes, (passes, scene.rows, 1, 1))
        )
        times = []
        for _ in range(REPEATED):
            began = process_time()
            scene.colours(views, look)
            times.append(process_time() - began)
        least.append(min(times))
    return 1e3 * float(np.median(least))


if __name__ == "__main__":
    main()
