"""VisitorScene: the scene of one visitor, at the time and in the view of its own."""

from __future__ import annotations

import viser

from quadsim.web.page.due import Due
from quadsim.web.page.forms.course_editor import CourseEditor
from quadsim.web.page.parts.moment import Moment
from quadsim.web.page.scene.camera import Camera
from quadsim.web.page.scene.edit_scene import EditScene
from quadsim.web.page.scene.race_scene import RaceScene, preview
from quadsim.web.page.stages import Stage
from quadsim.web.state.view import View

LIGHT = 1 / 5  # time between two updates of a scene that sends less [s]


class VisitorScene:
    """The scene of one visitor of viser's, which nobody else sees.

    Args:
        client: the visitor.
        camera: the cameras of all visitors.
        editor: of the course.
    """

    def __init__(self, client: viser.ClientHandle, camera: Camera, editor: CourseEditor):
        self._client = client
        self._camera = camera
        self._editor = editor
        self._built: object = None
        self._race: RaceScene | None = None
        self._edited: EditScene | None = None
        self._due = Due(0.0)
        self._light_due = Due(LIGHT)
        self._framed_gates = 0  # number of gates of the course in work that the camera frames

    def update(self, stage: Stage, moment: Moment, view: View) -> None:
        """Show a stage, and on it what the visitor watches."""
        with self._client.atomic():
            built = (stage, view.true_size and bool(stage.race))
            if built != self._built:
                self._built = built
                self._build(stage, view)
            if self._edited:
                self._update_edited(self._edited)
            elif self._race and moment.s.race == stage.race:
                self._update_race(self._race, moment, view)
                self._camera.follow(self._client, moment.timings)

    def _build(self, stage: Stage, view: View) -> None:
        """Build the scene anew."""
        scene = self._client.scene
        scene.reset()
        self._race = None
        self._edited = None
        if stage.is_edited:
            self._edited = self._editor.scene_in(scene)
            self._framed_gates = 0
            return
        if stage.course:
            self._camera.show(self._client, stage.course)
        if stage.race:
            self._race = RaceScene(scene, stage.entries, view.true_size)
            self._camera.set_size(self._client, self._race.drone_size)
        elif stage.course:
            self._camera.set_size(self._client, preview(scene, stage.course))

    def _update_edited(self, scene: EditScene) -> None:
        """Show the course in work; a handle under a hand is left where it is."""
        if self._due((scene, self._editor.shown, scene.is_dragged)):
            self._editor.show_in(scene)
            self._frame_edited()

    def _frame_edited(self) -> None:
        """Frame the course in work again if it has another number of gates."""
        framed = self._editor.framed()
        if len(framed.gates) == self._framed_gates:
            self._camera.frame_next(self._client, framed)
            return
        self._framed_gates = len(framed.gates)
        self._camera.show(self._client, framed)

    def _update_race(self, scene: RaceScene, moment: Moment, view: View) -> None:
        """Show the race."""
        due = self._light_due if view.light else self._due
        if not due((scene, moment, view)):
            return
        first = moment.timings[0]
        by_speed = view.by_speed(len(moment.timings))
        scene.update(moment.drawn(view.by_place), by_speed, view.shows_trajectories)
        scene.update_limit(first, view.limit, view.by_place)
