"""The value of a course: the time to go of a point mass, from any state to the finish.

`leg` has the least time between two states, `passages` the openings to fly through, and
`course_value` the best way through all of them with the value of states at each.
"""

from quadsim.value.course_value import CourseValue, value_of_course, value_of_passages
from quadsim.value.leg import PointMass, leg_time
from quadsim.value.passages import Passages, passages_of

__all__ = [
    "CourseValue",
    "Passages",
    "PointMass",
    "leg_time",
    "passages_of",
    "value_of_course",
    "value_of_passages",
]
