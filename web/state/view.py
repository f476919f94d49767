"""View: how a visitor sees the race in the scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from quadsim.web.state.fields import Shown

Ghosts = Literal["by time", "by place"]
Trails = Literal["auto", "speed", "sampler"]


@dataclass(frozen=True)
class View:
    """The choices of a visitor's display."""

    ghosts: Annotated[Ghosts, Shown("where the others are shown")] = "by time"
    trails: Annotated[Trails, Shown("what the colour of a trail says")] = "auto"
    trajectories: Annotated[
        bool, Shown("the cheapest of the samples; white: the plan", "Sampled trajectories")
    ] = True
    limit: Annotated[
        bool, Shown("the best known race of race limit, as a ghost", "Limit's race")
    ] = False
    true_size: Annotated[bool, Shown("of the drones, which are enlarged otherwise")] = False
    pictures: Annotated[
        bool,
        Shown(
            "what the first drone's camera sees at the time that is shown; a process of its own"
            " draws",
            "Camera pictures",
        ),
    ] = False
    light: Annotated[
        bool,
        Shown(
            "for a slow link: the scene 5 times a second, tables once, no sampled trajectories, no"
            " camera pictures",
            "Send less",
        ),
    ] = False

    @property
    def by_place(self) -> bool:
        """Whether the other competitors are shown at the place of the first."""
        return self.ghosts == "by place"

    @property
    def shows_trajectories(self) -> bool:
        """Whether the sampled trajectories are drawn."""
        return self.trajectories and not self.light

    @property
    def shows_pictures(self) -> bool:
        """Whether the pictures of the first drone's camera are drawn."""
        return self.pictures and not self.light

    def by_speed(self, competitors: int) -> bool:
        """Return whether trails are coloured by speed; by default with a single competitor."""
        return self.trails == "speed" or (self.trails == "auto" and competitors == 1)
