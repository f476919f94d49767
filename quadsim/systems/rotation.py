"""The rotations that costs use, by their earlier place: see `quadsim.rotation`."""

from quadsim.rotation import along, body_axes, to_body, to_world

__all__ = ["along", "body_axes", "to_body", "to_world"]
