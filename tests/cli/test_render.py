"""`race render`: pictures by one command that may be broken off; every mistake is one line."""

import json
from importlib.util import find_spec

import pytest
from PIL import Image
from run_cases import save, two_laps

from quadsim import Spec
from quadsim.campaign.run.pool import Pool
from quadsim.cli import render
from quadsim.cli.cli import race

SMALL = "width: 64\nheight: 36\nfx: 32\nfy: 32\ntilt_deg: 20\n"
# Command -> the beginning of its error: the setting or the name that is wrong
MISTAKES = {
    "render split_s_swfit": "no run or course 'split_s_swfit'",
    "render nothing": "no runs in 'runs'",
    "render split_s_swift --vary light,texture": "--vary: no 'texture'",
    "render split_s_swift --camera agp": "no camera 'agp'",
    "render split_s_swift --frames 0": "--frames: ",
    "render split_s_swift --out small.yaml": "small.yaml: ",
    "render last --film flight.mp4": "--film: expected FILE.webp or FILE.gif, got 'flight.mp4'",
    "render last --film nowhere/a.gif": "--film: expected a folder that exists, got 'nowhere'",
    "render figure8 --film a.gif": "--film: expected a run, got the course 'figure8'",
    "render last --film a.gif --mp4": "--film: expected neither --mp4 nor --vary",
    "render last --film a.gif": "no runs in 'runs'",
}


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder with a small camera; pictures are made in this process."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.yaml").write_text(SMALL)
    monkeypatch.setattr(render, "open_pool", lambda jobs: Pool())
    return tmp_path


@pytest.mark.parametrize("words", MISTAKES)
def test_a_mistake_is_one_line(words, here, capsys):
    assert race(words.split()) == 2
    written = capsys.readouterr()
    assert written.err.startswith(f"race render: {MISTAKES[words]}")
    assert (written.out, written.err.count("\n")) == ("", 1)
    assert [path.name for path in here.iterdir()] == ["small.yaml"]


@pytest.mark.slow
@pytest.mark.compiled
def test_pictures_are_made_once_and_more_of_them_later(here, capsys):
    words = ["render", "figure8", "--camera", "small.yaml", "--vary", "all", "--json"]
    assert race([*words, "--frames", "5"]) == 0
    assert json.loads(capsys.readouterr().out) | {"per_second": 0} == {
        "out": "pictures", "pictures": 5, "made": 5, "per_second": 0,
    }  # fmt: skip
    times = {path: path.stat().st_mtime_ns for path in here.glob("pictures/*/*")}
    assert len(times) == 4 * 5
    assert race([*words, "--frames", "7"]) == 0
    assert json.loads(capsys.readouterr().out)["made"] == 2
    assert {path: path.stat().st_mtime_ns for path in times} == times
    assert len(json.loads((here / "pictures" / "annotations.json").read_bytes())["images"]) == 7
    assert race([*words, "--seed", "1"]) == 2
    assert "pictures: has pictures of other settings (seed)" in capsys.readouterr().err


@pytest.mark.compiled
def test_ctrl_c_leaves_whole_pictures_and_says_how_many(here, capsys, monkeypatch):
    class Broken(Pool):
        calls = 0

        def submit(self, fly, job):
            self.calls += 1
            if self.calls == 2:
                raise KeyboardInterrupt
            return super().submit(fly, job)

    monkeypatch.setattr(render, "open_pool", lambda jobs: Broken())
    words = ["render", "figure8", "--camera", "small.yaml", "--frames", "9"]
    assert race(words) == 130
    err = capsys.readouterr().err
    assert err.startswith("race render: interrupted, 4 of 9 ")
    assert err.count("\n") == 1
    monkeypatch.setattr(render, "open_pool", lambda jobs: Pool())
    assert race(words) == 0
    assert "9 pictures in pictures: 5 made" in capsys.readouterr().out


@pytest.mark.compiled
@pytest.mark.process
@pytest.mark.skipif(
    not find_spec("imageio_ffmpeg"), reason="imageio-ffmpeg is not installed: extra render"
)
def test_a_film_has_as_many_pictures(here):
    import imageio_ffmpeg

    assert race(["render", "figure8", "--camera", "small.yaml", "--frames", "3", "--mp4"]) == 0
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(here / "pictures" / "video.mp4"))
    assert (frames, seconds) == (3, pytest.approx(0.1))


@pytest.mark.compiled
def test_a_film_of_a_stored_run_is_one_file_of_as_many_pictures_as_asked_for(here, capsys):
    save("runs", two_laps(Spec.of("figure8", laps=2).record()))
    before = set(here.iterdir())
    words = "render last --film flight.webp --camera small.yaml --frames 3 --json"
    assert race(words.split()) == 0
    assert json.loads(capsys.readouterr().out) == {"film": "flight.webp", "pictures": 3}
    assert set(here.iterdir()) - before == {here / "flight.webp"}
    with Image.open("flight.webp") as film:
        assert (film.n_frames, film.size) == (3, (64, 36))


def test_without_the_extra_for_films_one_line_says_what_installs_it(here, capsys, monkeypatch):
    monkeypatch.setattr(render, "find_spec", lambda name: None)
    assert race(["render", "figure8", "--mp4"]) == 2
    assert "--mp4: imageio-ffmpeg is not installed: " in capsys.readouterr().err
