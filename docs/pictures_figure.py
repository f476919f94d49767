"""The picture of pictures.md, in some seconds: `.venv/bin/python docs/pictures_figure.py`."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from shared import save

from quadsim.course import load_course
from quadsim.render.labels import label
from quadsim.render.look import VARIED, drawn_look, plain_look
from quadsim.render.poses import drawn_poses
from quadsim.render.scene import Scene
from quadsim.sensing.camera import load_camera
from quadsim.streams import look_streams

COURSE, CAMERA = load_course("split_s_swift"), load_camera("aigp")
SHOWN = ((None, 0), (2, 5), (4, 11))  # seed of the look (None: plain), number of the pose
FAR = 30.0  # depth that is drawn white [m]


def main() -> None:
    scene, poses = Scene(COURSE, CAMERA), drawn_poses(COURSE, CAMERA, 12, seed=0)
    figure, axes = plt.subplots(3, len(SHOWN), figsize=(9.6, 5.5), layout="constrained")
    for (seed, i), (colour, depth, segmentation) in zip(SHOWN, axes.T, strict=True):
        look = plain_look() if seed is None else drawn_look(look_streams(seed, 0), VARIED)
        seen = scene.shoot(poses[i].p, poses[i].q, look)
        colour.imshow(seen.rgb)
        for gate in label(COURSE, CAMERA, poses[i], seen.segmentation)["gates"]:
            u, v, shown = np.reshape(gate["keypoints"], (4, 3)).T
            colour.plot(u[shown == 2], v[shown == 2], "+", color="cyan", markersize=5)
            colour.plot(u[shown == 1], v[shown == 1], "x", color="red", markersize=4)
        depth.imshow(np.minimum(seen.depth, FAR), cmap="gray", vmin=0.0, vmax=FAR)
        segmentation.imshow(
            np.where(seen.segmentation == 255, 9, seen.segmentation), cmap="tab10", vmin=0, vmax=9
        )
        for panel in (colour, depth, segmentation):
            panel.set_axis_off()
    save(figure, "pictures.png", dpi=110)


if __name__ == "__main__":
    main()
