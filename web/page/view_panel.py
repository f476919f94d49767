"""The controls of what all visitors see of the shown race."""

from __future__ import annotations

import viser

TIME, PLACE = "by time", "by place"
AUTO, SPEED, SAMPLER = "auto", "speed", "sampler"


class ViewPanel:
    """The controls of the display that all visitors share: ghosts, size and colours."""

    def __init__(self, gui: viser.GuiApi):
        with gui.add_folder("View"):
            hint = "where the others are shown"
            ghosts = (TIME, PLACE)
            self.ghosts = gui.add_dropdown("Ghosts", ghosts, initial_value=TIME, hint=hint)
            trails = (AUTO, SPEED, SAMPLER)
            self.trails = gui.add_dropdown("Trails", trails, initial_value=AUTO)
            hint = "the cheapest of the samples; white: the plan"
            self.trajectories = gui.add_checkbox("Sampled trajectories", True, hint=hint)
            hint = "the best known race of race limit, as a ghost"
            self.limit = gui.add_checkbox("Limit's race", False, hint=hint)
            hint = "of the drones, from the next start"
            self.true_size = gui.add_checkbox("True size", False, hint=hint)

    @property
    def by_place(self) -> bool:
        """Whether the other competitors are shown at the place of the first."""
        return self.ghosts.value == PLACE

    def by_speed(self, competitors: int) -> bool:
        """Return whether trails are coloured by speed; by default with a single competitor."""
        return self.trails.value == SPEED or (self.trails.value == AUTO and competitors == 1)
