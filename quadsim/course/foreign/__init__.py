"""Readers of other simulators' course files, which convert them to courses of this project.

    lsy            LSY drone racing, levels in TOML
    airsim         AirSim's poses of gates, as the Game of Drones (NeurIPS 2019) returns them
    flightgoggles  FlightGoggles, gates by their corners
    uzh            tracks of Flightmare, Agilicious and other simulators of UZH's RPG, in YAML
    csv            a table with x, y, z and a direction for each gate

One module reads one format, and returns a `ForeignTrack` in the axes and units of its file.
`convert_course` turns the gates' passages and positions into this project's axes, and checks the
course as a course file is checked.
"""

from quadsim.course.foreign.convert import FORMATS, Conversion, Reading, convert, convert_course

__all__ = ["FORMATS", "Conversion", "Reading", "convert", "convert_course"]
