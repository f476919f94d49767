"""Models as plain functions over named scalars (`system`), and the quadrotor's (`quadrotor`)."""

from quadsim.dynamics.system import System

__all__ = ["System"]
