"""Courses: gates, obstacles, start and bounds, read from YAML files and checked."""

from quadsim.course.course import Course, parse_course
from quadsim.course.course_file import Published
from quadsim.course.gate import EstimatedGate, Gate, Start
from quadsim.course.load import COURSES, course_names, load_course
from quadsim.course.obstacles import Box, Cylinder, Obstacle
from quadsim.course.opening import FRAME_DEPTH, InGate
from quadsim.rotation import Vec3, in_frame

__all__ = [
    "COURSES",
    "FRAME_DEPTH",
    "Box",
    "Course",
    "Cylinder",
    "EstimatedGate",
    "Gate",
    "InGate",
    "Obstacle",
    "Published",
    "Start",
    "Vec3",
    "course_names",
    "in_frame",
    "load_course",
    "parse_course",
]
