"""Folders of pictures, with the pictures' common settings, all labels, and a film."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from quadsim.files.arrays import read_bytes
from quadsim.files.atomic import replace_file
from quadsim.files.locks import lock_folder
from quadsim.files.strict_yaml import FileError
from quadsim.render.frames import LARGEST_JSON, SUFFIXES, Pictures, path_of, whole_label
from quadsim.render.labels import coco

SETTINGS = "settings.json"
ANNOTATIONS = "annotations.json"
VIDEO = "video.mp4"


@contextmanager
def claimed(out: Path, pictures: Pictures) -> Iterator[None]:
    """Lock a folder for one process, and remove partial files of killed processes.

    The folder is made, or continued if its pictures have the same settings.

    Raises:
        FileError: the folder has pictures of different settings or foreign files, or is locked by
            another process.
        OSError: the folder cannot be made.
    """
    _make(out, pictures)
    with _locked(out):
        for kind in SUFFIXES:
            for left in (out / kind).glob("*.tmp"):
                left.unlink(missing_ok=True)
        yield


@contextmanager
def _locked(out: Path) -> Iterator[None]:
    """Lock a folder, if the file system supports locks. Raises FileError."""
    handle = None
    try:
        handle = lock_folder(out)
    except BlockingIOError:
        advice = "wait for it, or name another folder"
        raise FileError(f"{out}: another process makes pictures there: {advice}") from None
    except OSError:
        pass
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _make(out: Path, pictures: Pictures) -> None:
    """Make the folder and its settings, or check existing settings."""
    path = out / SETTINGS
    settings = pictures.settings()
    if out.exists() and not out.is_dir():
        raise FileError(f"{out}: expected a folder, got a file")
    if path.exists():
        before = _read(path)
        differ = [key for key in settings if settings[key] != before.get(key)]
        if differ:
            names = ", ".join(differ)
            raise FileError(f"{out}: has pictures of other settings ({names}): name another folder")
    elif out.exists() and any(out.iterdir()):
        raise FileError(f"{out}: expected a new folder or one of race render, found other files")
    for kind in SUFFIXES:
        (out / kind).mkdir(parents=True, exist_ok=True)
    if not path.exists():
        replace_file(path, json.dumps(settings, indent=1).encode())


def _read(path: Path) -> dict[str, Any]:
    """Return the settings in this file. Raises FileError."""
    before: Any = None
    with suppress(ValueError):
        before = json.loads(read_bytes(path, "the settings of pictures", LARGEST_JSON))
    if not isinstance(before, dict):
        advice = "name another folder, or remove this one"
        raise FileError(f"{path}: expected the settings of pictures: {advice}")
    return before


def whole(out: Path, count: int) -> set[int]:
    """Return the numbers of the complete pictures among the first `count` pictures."""
    return {i for i in range(count) if whole_label(out, i)}


def annotate(out: Path, pictures: Pictures, count: int) -> None:
    """Write all labels of the first `count` pictures as one document. Raises OSError."""
    labels = (whole_label(out, i) for i in range(count))
    document = coco(pictures.course, pictures.camera, filter(None, labels))
    replace_file(out / ANNOTATIONS, json.dumps(document).encode())


def write_mp4(out: Path, pictures: Pictures, count: int) -> None:
    """Write the first `count` pictures as a film at the camera's rate.

    Raises:
        ImportError: imageio-ffmpeg is not installed.
        OSError: the film cannot be written.
    """
    # imported here, as its library is an extra
    from quadsim.render.video import write_video

    camera = pictures.camera
    paths = (path_of(out, "rgb", i) for i in range(count))
    write_video(paths, (camera.width, camera.height), camera.rate, out / VIDEO)
