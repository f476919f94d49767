"""EditScene: the edited course, and the handle of the chosen item."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from itertools import count, pairwise

import numpy as np
import viser

from quadsim.course import Course, Cylinder
from quadsim.web.course.draft import Draft, Item, Pose
from quadsim.web.page.scene.drones import add_lights, single_colour
from quadsim.web.page.scene.race_scene import CourseView, add_ground

# colours
STARTS = (86, 180, 233)
CHOSEN = (240, 228, 66)
LIMIT = (230, 159, 0)
OBSTACLE = (176, 150, 110)
WRONG = (255, 107, 107)

# [m] length of the arrow at the start
ARROW = 1.0
# size of a handle: share of the course's extent, and its least share of the widest opening
OF_COURSE = 0.07
OF_GATE = 1.2
# [m] assumed opening without gates
OPENING = 1.5

# Called with the pose of a dragged handle, and with None at its release
Dragged = Callable[[Pose | None], Awaitable[None]]
Clicked = Callable[[Item], Awaitable[None]]


class EditScene:
    """Shows a draft. One thread uses it; `dragged` and `clicked` are called on viser's event loop.

    Args:
        scene: the scene, which is empty.
        dragged: called with the poses of the handle.
        clicked: called with the clicked gate or obstacle.

    Attributes:
        is_dragged: whether a visitor drags the handle, whose pose is then not set.
    """

    def __init__(self, scene: viser.SceneApi, dragged: Dragged, clicked: Clicked):
        self.is_dragged = False
        self._scene = scene
        self._dragged = dragged
        self._clicked = clicked
        self._handles = count()
        self._handle: viser.TransformControlsHandle | None = None
        self._view: CourseView | None = None
        self._shape: object = None
        self._item: Item | None = None
        self._limit: viser.LineSegmentsHandle | None = None

    def show(self, draft: Draft, wrong: frozenset[Item]) -> None:
        """Show a draft; wrong: items with errors."""
        course = draft.drawn()
        if shape_of(course) != self._shape:
            self._build(course)
        elif self._view:
            self._view.move(course)
        self._start.position = course.start.position
        self._start.wxyz = (np.cos(course.start.yaw / 2), 0.0, 0.0, np.sin(course.start.yaw / 2))
        self._colour(draft.item, wrong)
        self._place_handle(draft, course)

    def show_limit(self, path: np.ndarray | None) -> None:
        """Show the path of the best known solution (n, 3) [m], or none."""
        if self._limit:
            self._limit.remove()
            self._limit = None
        if path is not None and len(path) > 1:
            lines = np.array(list(pairwise(path)), np.float32)
            self._limit = self._scene.add_line_segments(
                "/edit/limit", lines, single_colour(LIMIT), thickness=0.06
            )

    def _build(self, course: Course) -> None:
        """Rebuild the scene, after a change of the number of gates or of obstacles' sizes."""
        self._scene.reset()
        self._shape = shape_of(course)
        self._handle = None
        self._limit = None
        add_lights(self._scene)
        self._start = self._scene.add_line_segments(
            "/edit/start", arrow(), single_colour(STARTS), thickness=0.08
        )
        self._scene.add_label("/edit/start/name", "start", position=(0.0, 0.0, 0.4))
        if not course.gates:
            self._view = None
            add_ground(self._scene, course)
            return
        self._view = CourseView(self._scene, course)

        @self._view.bars.on_click
        async def _(event: viser.SceneNodePointerEvent[viser.BatchedMeshHandle]) -> None:
            # Each gate has four bars
            await self._clicked(Item("gate", (event.instance_index or 0) // 4))

        for index, node in enumerate(self._view.obstacles):
            self._let_be_clicked(node, Item("obstacle", index))

    def _let_be_clicked(self, node: viser.MeshHandle, item: Item) -> None:
        @node.on_click
        async def _(_: viser.SceneNodePointerEvent[viser.MeshHandle]) -> None:
            await self._clicked(item)

    def _colour(self, chosen: Item, wrong: frozenset[Item]) -> None:
        """Colour the chosen item, and the items with errors."""
        if self._view is None:
            return
        gates = {item.index + 1 for item in wrong if item.kind == "gate"}
        is_shown = chosen.kind == "gate" and chosen not in wrong
        self._view.colour(chosen.index + 1 if is_shown else 0, gates)
        for index, node in enumerate(self._view.obstacles):
            item = Item("obstacle", index)
            colour = WRONG if item in wrong else CHOSEN if item == chosen else OBSTACLE
            if tuple(node.color) != colour:
                node.color = colour

    def _place_handle(self, draft: Draft, course: Course) -> None:
        """Put the handle at the chosen item."""
        pose = draft.pose
        if self._handle and (draft.item != self._item or pose is None):
            self._handle.remove()
            self._handle = None
        self._item = draft.item
        if pose is None:
            return
        if self._handle is None:
            self._handle = self._add_handle(draft, course, pose)
        elif not self.is_dragged:
            self._handle.position = pose.position
            self._handle.wxyz = pose.attitude

    def _add_handle(
        self, draft: Draft, course: Course, pose: Pose
    ) -> viser.TransformControlsHandle:
        """Add a handle with a unique name, as an old one may still be dragged."""
        self.is_dragged = False
        item = draft.item
        is_pole = item.kind == "obstacle" and isinstance(course.obstacles[item.index], Cylinder)
        handle = self._scene.add_transform_controls(
            f"/edit/handle/{next(self._handles)}",
            scale=handle_size(course),
            disable_rotations=is_pole,
            depth_test=False,
            position=pose.position,
            wxyz=pose.attitude,
        )

        @handle.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            # A handle of a formerly chosen item has no effect any more.
            if event.target is not self._handle:
                return
            x, y, z = (float(each) for each in handle.position)
            qw, qx, qy, qz = (float(each) for each in handle.wxyz)
            self.is_dragged = event.phase != "end"
            await self._dragged(Pose((x, y, z), (qw, qx, qy, qz)) if self.is_dragged else None)

        return handle


def handle_size(course: Course) -> float:
    """Return the size of a handle that can be grabbed in a view of the whole course [m]."""
    extent = float(np.linalg.norm(np.ptp(course.points(), axis=0)))
    widest = max((max(gate.opening) for gate in course.gates), default=OPENING)
    return max(OF_COURSE * extent, OF_GATE * widest)


def shape_of(course: Course) -> object:
    """Return the key of a scene: the number of gates, and the obstacles' sizes."""
    sizes = [
        (obstacle.radius, obstacle.height) if isinstance(obstacle, Cylinder) else obstacle.size
        for obstacle in course.obstacles
    ]
    return len(course.gates), sizes


def arrow() -> np.ndarray:
    """Return an arrow along x.  (segments, 2, 3)"""
    tip = (ARROW, 0.0, 0.0)
    sides = [(0.7 * ARROW, side * 0.2 * ARROW, 0.0) for side in (-1.0, 1.0)]
    lines = [((0.0, 0.0, 0.0), tip), *((tip, side) for side in sides)]
    return np.array(lines, np.float32)
