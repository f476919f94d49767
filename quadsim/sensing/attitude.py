"""The rotations that the estimator uses, by their earlier place and names: see `quadsim.rotation`."""

from quadsim.rotation import between, exp, log, matrix, product, skew, to_body, to_world, turned

Vector = tuple[float, ...]
rotate = to_world
rotate_back = to_body

__all__ = ["Vector", "between", "exp", "log", "matrix", "product", "rotate", "rotate_back", "skew", "turned"]
