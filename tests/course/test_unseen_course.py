"""A course that nothing was tuned for: a climb, a gate that looks up, a stacked pair."""

import pytest

import quadsim

UNSEEN = """
opening: [1.6, 1.6]
start: {position: [0, 0, 1], yaw_deg: 0}
gates:
  - {position: [8, 0, 2], yaw_deg: 0}
  - {position: [14, 0, 8], yaw_deg: 0, pitch_deg: -80}
  - {position: [14, 3, 14], yaw_deg: 90}
  - {position: [14, 12, 12], yaw_deg: 90}
  - {position: [14, 12, 9.8], yaw_deg: -90}
  - {position: [5, 4, 3], yaw_deg: -135, roll_deg: 30}
"""


@pytest.mark.regression
def test_an_unseen_course_with_a_12_m_climb_and_stacked_gates_flies_from_its_yaml_alone(tmp_path):
    course = tmp_path / "unseen.yaml"
    course.write_text(UNSEEN)
    run = quadsim.fly(course=str(course))
    assert run.outcome == "finished"
    assert [event.gate for event in run.events if event.kind == "pass"] == [1, 2, 3, 4, 5, 6]
