"""The folder of pictures: settings that all of them share, one document of all labels, the film."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from quadsim.files.atomic import replace_file
from quadsim.files.strict_yaml import FileError
from quadsim.render.frames import SUFFIXES, Pictures, path_of, whole_label
from quadsim.render.labels import coco

SETTINGS, ANNOTATIONS, VIDEO = "settings.json", "annotations.json", "video.mp4"


def settle(out: Path, pictures: Pictures) -> None:
    """Make the folder, or see that it has pictures of the same settings. Raises FileError,
    OSError."""
    path, settings = out / SETTINGS, pictures.settings()
    if out.exists() and not out.is_dir():
        raise FileError(f"{out}: expected a folder, got a file")
    if path.exists():
        before = _read(path)
        differ = [key for key in settings if settings[key] != before.get(key)]
        if differ:
            raise FileError(
                f"{out}: has pictures of other settings ({', '.join(differ)}): name another folder"
            )
    elif out.exists() and any(out.iterdir()):
        raise FileError(f"{out}: expected a new folder or one of race render, found other files")
    for kind in SUFFIXES:
        (out / kind).mkdir(parents=True, exist_ok=True)
        for left in (out / kind).glob("*.tmp"):  # of a worker that was killed
            left.unlink(missing_ok=True)
    if not path.exists():
        replace_file(path, json.dumps(settings, indent=1).encode())


def _read(path: Path) -> dict[str, Any]:
    before: Any = None
    with suppress(ValueError):
        before = json.loads(path.read_bytes())
    if not isinstance(before, dict):
        raise FileError(
            f"{path}: expected the settings of pictures: name another folder, or remove this one"
        )
    return before


def whole(out: Path, count: int) -> set[int]:
    """Which of the first `count` pictures are there, whole."""
    return {i for i in range(count) if whole_label(out, i)}


def annotate(out: Path, pictures: Pictures, count: int) -> None:
    """All labels of the first `count` pictures as one document. Raises OSError."""
    labels = (whole_label(out, i) for i in range(count))
    document = coco(pictures.course, pictures.camera, filter(None, labels))
    replace_file(out / ANNOTATIONS, json.dumps(document).encode())


def film(out: Path, pictures: Pictures, count: int) -> None:
    """The first `count` pictures at the camera's rate. Raises ImportError, OSError."""
    from quadsim.render.video import write_video  # whose library is an extra

    camera = pictures.camera
    paths = (path_of(out, "rgb", i) for i in range(count))
    write_video(paths, (camera.width, camera.height), camera.rate, out / VIDEO)
