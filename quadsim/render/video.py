"""Pictures as a film: H.264 in an MP4 file, by the ffmpeg that imageio-ffmpeg brings."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
from PIL import Image


def write_video(pictures: Iterable[Path], size: tuple[int, int], rate: float, path: Path) -> None:
    """PNG files of width x height [px] as one film at `rate` [Hz]; whole or not at all.

    Raises ImportError without imageio-ffmpeg, OSError where it cannot be written.
    """
    import imageio_ffmpeg  # of the extra `render`

    temporary = path.with_name(f"{uuid4().hex}.tmp.mp4")
    fps: Any = rate  # the library says int and takes any number
    writer = imageio_ffmpeg.write_frames(
        str(temporary), size, fps=fps, macro_block_size=2, quality=7, ffmpeg_log_level="error"
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
