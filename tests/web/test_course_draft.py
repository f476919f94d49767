"""A course that is edited without a page: its changes, undo, checks, file and limit."""

from dataclasses import replace
from math import radians
from pathlib import Path

import pytest
from web_cases import until

from quadsim.cli.check import examine
from quadsim.course import course_names, load_course, parse_course
from quadsim.limit.limits import limits_folder
from quadsim.rotation import from_euler
from quadsim.web.course.draft import BOUNDS, MOST, START, Draft, Item, Pose
from quadsim.web.course.edit import CourseEdit
from quadsim.web.course.folder import WRITTEN, CourseFolder
from quadsim.web.course.history import TOGETHER, History
from quadsim.web.course.numbers import FRAME, HEIGHT, OPENING, POSITION, SPANS, YAW

X, Y, Z = POSITION


def short():
    """Two gates and a pole."""
    return Draft.empty().add_gate().add_gate().add_pole()


@pytest.mark.parametrize("name", course_names())
def test_a_copy_is_the_same_course_but_for_its_source_and_published_times(name):
    course = load_course(name)
    draft = Draft.copy_of(course)
    assert draft.errors(name) == []
    read = parse_course(draft.text(), f"{name}.yaml")
    assert replace(read, text="", source="") == replace(
        course, text="", source="", name=name, published=()
    )


def test_what_is_drawn_is_what_the_file_describes():
    draft = short().choose(Item("gate", 1))
    draft = draft.with_numbers({Y: 2.25, YAW: 30.0, OPENING[0]: 2.0, FRAME: 0.2})
    draft = draft.add_box().with_course(loop=True, laps=2)
    assert parse_course(draft.text(), "draft.yaml") == draft.course() == draft.drawn()
    assert draft.course().gates[1].yaw == radians(30.0)


def test_gates_are_added_behind_the_chosen_one_put_earlier_and_deleted():
    draft = short().choose(Item("gate", 0)).with_numbers({YAW: 90.0})
    draft = draft.add_gate()
    assert draft.item == Item("gate", 1)
    new = draft.numbers()
    assert (new[X], new[Y], new[YAW]) == (5.0, 5.0, 90.0)
    xs = [gate.position[0] for gate in draft.shift(-1).entries.gates]
    ys = [gate.position[1] for gate in draft.shift(-1).entries.gates]
    assert (xs, ys) == ([5.0, 5.0, 10.0], [5.0, 0.0, 0.0])
    assert draft.shift(-1).shift(-1) == draft.shift(-1)
    assert (
        draft.delete().entries == short().choose(Item("gate", 0)).with_numbers({YAW: 90.0}).entries
    )
    assert draft.choose(START).delete().entries == draft.entries
    empty = draft.delete().delete().delete()
    assert (empty.entries.gates, empty.item) == ((), START)


def test_a_draft_takes_so_many_gates_and_no_more():
    draft = Draft.empty()
    for _ in range(MOST):
        draft = draft.add_gate()
    with pytest.raises(ValueError, match="gates"):
        draft.add_gate()


def test_a_handle_moves_by_steps_and_leaves_alone_what_it_does_not_move():
    """An angle of more digits stays where a gate is only moved."""
    draft = Draft.copy_of(load_course("lsy_level2"))
    x, y, z = draft.pose.position
    moved = draft.moved_to(Pose((x + 0.5013, y + 1e-9, z), draft.pose.attitude))
    gate, before = moved.entries.gates[0], draft.entries.gates[0]
    assert gate.position == (pytest.approx(1.0), *before.position[1:])
    assert gate.yaw_deg == before.yaw_deg == -44.691
    turned = draft.moved_to(Pose((x, y, z), from_euler(radians(20.04), radians(-10.0), 0.0)))
    gate = turned.entries.gates[0]
    assert (gate.yaw_deg, gate.pitch_deg, gate.roll_deg) == (20.0, -10.0, 0.0)
    assert gate.position == before.position
    pole = draft.choose(Item("obstacle", 0))
    upright = pole.moved_to(Pose((0.3, 0.0, 0.0), from_euler(1.0, 1.0, 0.0)))
    assert upright.numbers()[X] == 0.3
    bounds = upright.choose(BOUNDS)
    assert bounds.moved_to(Pose((9.0, 9.0, 9.0), from_euler(0.0, 0.0, 0.0))) == bounds


def test_bounds_are_the_default_ones_until_they_are_typed_and_once_they_are_deleted():
    draft = short().choose(BOUNDS)
    assert draft.numbers()[SPANS[0]] == draft.course().bounds[0][0]
    assert draft.entries.bounds is None
    narrow = draft.with_numbers({SPANS[1]: 10.1})
    assert narrow.course().bounds[0][1] == 10.1
    (error,) = narrow.errors("narrow")
    assert error.key == "gates[1].position"
    assert narrow.delete().entries == draft.entries


def test_undo_goes_back_by_changes_and_not_by_digits():
    history = History(short())
    first = history.draft
    for k, digits in enumerate((1.0, 12.0, 12.5)):
        history = history.change(first.with_numbers({X: digits}), "x", now=0.3 * k)
    typed = history.draft
    history = history.change(typed.with_numbers({X: 13.0}), "x", now=0.6 + 2 * TOGETHER)
    history = history.change(history.draft.choose(START))  # a choice is no change
    assert history.undo().draft == typed
    assert history.undo().undo().draft == first
    assert history.undo().undo().undo().draft == first
    assert history.undo().undo().redo().draft == typed
    assert history.undo().redo().draft.entries == history.draft.entries
    other = history.undo().change(first)
    assert other.redo() == other


def test_the_errors_are_those_of_race_check(tmp_path):
    """All of them, the first one first; what cannot be read hides what does not fit together."""
    draft = short().choose(Item("gate", 0)).with_numbers({Z: 0.5})
    draft = draft.choose(Item("obstacle", 0)).with_numbers({X: 900.0, Y: 900.0})
    draft = draft.choose(START).with_numbers({Z: -1.0})
    file = tmp_path / "mine.yaml"
    file.write_text(draft.text())
    edit = CourseEdit(str(tmp_path))
    edit.change(draft)
    checked = edit.check("mine", "swift")
    assert f"{tmp_path}/{checked.errors[0]}" == examine(str(file))["error"]
    assert len(checked.errors) == 2
    assert checked.wrong == {START, Item("gate", 0)}
    edit.change(draft.choose(Item("obstacle", 0)).with_numbers({HEIGHT: 0.0}))
    (only,) = edit.check("mine", "swift").errors
    assert "obstacles[0].cylinder.height" in only


def test_a_gate_too_small_for_the_vehicle_is_an_error(tmp_path):
    edit = CourseEdit(str(tmp_path))
    edit.change(short().choose(Item("gate", 1)).with_numbers({OPENING[0]: 0.2, OPENING[1]: 0.2}))
    checked = edit.check("mine", "swift")
    assert "for swift" in checked.errors[0]
    assert checked.wrong == {Item("gate", 1)}
    assert edit.check("mine", "crazyflie").errors == ()


def test_a_draft_is_saved_as_the_course_that_is_read_back(tmp_path):
    edit = CourseEdit(str(tmp_path))
    edit.change(short())
    assert edit.saved_as == ""
    path = edit.save("mine")
    assert path == str(tmp_path / "courses" / "mine.yaml")
    assert load_course(path) == edit.draft.course("mine")
    assert edit.saved_as == path
    edit.change(edit.draft.add_gate())
    assert edit.saved_as == ""
    assert edit.save("mine") == path  # it is our own
    assert len(load_course(path).gates) == 3
    assert CourseFolder(tmp_path).files() == (path,)
    assert [file.name for file in path_files(tmp_path)] == ["mine.yaml"]


def path_files(folder):
    return [file for file in folder.rglob("*") if file.is_file() and file.name != WRITTEN]


@pytest.mark.parametrize(
    "name",
    ["", "../evil", "a/b", "/tmp/evil", "a b", ".hidden", "x" * 65, "a\n", "figure8", "Figure8"],
)
def test_a_name_that_leaves_the_folder_or_is_a_shipped_courses_is_refused(tmp_path, name):
    with pytest.raises(ValueError, match="name of the course"):
        CourseFolder(tmp_path).save(short(), name)
    assert path_files(tmp_path) == []


def test_another_ones_file_is_not_written_over(tmp_path):
    """Neither one that was there before, nor one that was changed by hand since."""
    other = CourseFolder(tmp_path)
    path = other.save(short(), "mine")
    # after the server has started again the page knows its own files
    assert CourseFolder(tmp_path).save(short().add_gate(), "mine") == path
    (tmp_path / "courses" / "theirs.yaml").write_text(short().text())
    with pytest.raises(ValueError, match="new name"):
        other.save(short().add_gate(), "theirs")
    with open(path, "a") as file:
        file.write("# by hand\n")
    with pytest.raises(ValueError, match="new name"):
        other.save(short().add_gate(), "mine")
    elsewhere = tmp_path / "elsewhere.yaml"
    (tmp_path / "courses" / "link.yaml").symlink_to(elsewhere)
    with pytest.raises(ValueError, match="new name"):
        other.save(short(), "link")
    assert not elsewhere.exists()


def test_a_course_that_a_save_has_replaced_is_put_back(tmp_path):
    edit = CourseEdit(str(tmp_path))
    edit.change(edit.draft.add_gate())
    path = edit.save("mine")
    first = Path(path).read_text()
    edit.save("mine")
    assert edit.replaced == ""  # the same course
    edit.change(edit.draft.add_gate())
    edit.save("mine")
    assert edit.replaced.startswith("mine.yaml: 1 gate,")
    assert edit.put_back() == path
    assert Path(path).read_text() == first
    assert (edit.replaced, edit.saved_as) == ("", "")
    # A file that somebody else has changed meanwhile stays.
    edit.save("mine")
    Path(path).write_text("another one's")
    with pytest.raises(ValueError, match="got a changed file"):
        edit.put_back()
    assert Path(path).read_text() == "another one's"


def test_a_draft_with_errors_is_neither_saved_nor_searched(tmp_path):
    edit = CourseEdit(str(tmp_path))
    with pytest.raises(ValueError, match="gates"):
        edit.save("mine")
    with pytest.raises(ValueError, match="gates"):
        edit.begin_search("mine", "swift")
    assert path_files(tmp_path) == []


def test_another_course_that_is_begun_is_undone_like_any_change(tmp_path):
    edit = CourseEdit(str(tmp_path))
    edit.change(short())
    edit.begin(load_course("figure8"))
    assert len(edit.draft.entries.gates) == 8
    edit.begin(None)
    edit.undo()
    edit.undo()
    assert edit.draft.entries == short().entries


@pytest.mark.process
def test_a_limit_is_searched_in_a_process_that_is_cancelled(tmp_path):
    pytest.importorskip("casadi", reason="casadi is not installed (pip install -e '.[limit]')")
    edit = CourseEdit(str(tmp_path))
    edit.change(short())
    edit.begin_search("mine", "swift")
    search = edit.search
    with pytest.raises(ValueError, match="a search is on"):
        edit.begin_search("mine", "swift")
    # The first start is solved, and kept as by `race limit`.
    assert until(lambda: search.progress.best is not None, seconds=90)
    edit.cancel_search()
    assert not search.is_on
    assert not search._process.is_alive()
    limit = edit.check("mine", "swift").limit
    assert limit.time == pytest.approx(search.progress.best)
    assert list(limits_folder(tmp_path).glob("*.npz"))
    # The limit is of these gates
    edit.change(edit.draft.choose(Item("gate", 1)).with_numbers({X: 10.5}))
    assert edit.check("mine", "swift").limit is None
