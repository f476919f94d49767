"""Write films of pictures, H.264 in an MP4 file, with the ffmpeg of imageio-ffmpeg."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
from PIL import Image


def write_video(pictures: Iterable[Path], size: tuple[int, int], rate: float, path: Path) -> None:
    """Write PNG files as one film; if writing fails, no partial file remains.

    Args:
        pictures: the files in order.
        size: width and height of the pictures [px].
        rate: pictures per second [Hz].
        path: path of the film.

    Raises:
        ImportError: imageio-ffmpeg, of the extra `render`, is not installed.
        OSError: the film cannot be written.
    """
    import imageio_ffmpeg

    temporary = path.with_name(f"{uuid4().hex}.tmp.mp4")
    # the library's annotation is int, but any number works
    fps: Any = rate
    writer = imageio_ffmpeg.write_frames(
        str(temporary),
        size,
        fps=fps,
        macro_block_size=2,
        quality=7,
        ffmpeg_log_level="error",
    )
    try:
        writer.send(None)
        for picture in pictures:
            writer.send(np.asarray(Image.open(picture).convert("RGB")).tobytes())
        writer.close()
        temporary.replace(path)
    finally:
        writer.close()
        temporary.unlink(missing_ok=True)
