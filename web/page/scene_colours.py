"""Colours of the scene: what to send so that the screen shows the colours of the legend.

The page's renderer (three.js) takes colours in an array, of lines or batched meshes, as linear light, a single colour
of a mesh or of lines as sRGB, and maps both by its fit of the ACES filmic curve: sent as they are, all come out pale.
That mapping, x -> sRGB(O f(I x / 0.6)), is inverted here. (Stephen Hill's fit, in tonemapping_pars_fragment.glsl.js)
"""

from __future__ import annotations

import numpy as np
import viser

INTO = np.array([[0.59719, 0.35458, 0.04823], [0.076, 0.90834, 0.01566], [0.0284, 0.13383, 0.83777]])  # I
OUT = np.array([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]])  # O
EXPOSURE = 0.6
BRIGHT = np.pi  # intensity of a light under which a mesh has its own colour, its reflection being colour / pi


def array_colour(rgb: tuple[int, int, int] | np.ndarray) -> np.ndarray:
    """To be sent in an array for what is to look like this sRGB colour.  (..., 3) uint8, as given"""
    return np.rint(255 * _linear(rgb)).astype(np.uint8)


def single_colour(rgb: tuple[int, int, int] | np.ndarray) -> tuple[int, int, int]:
    """To be sent alone for what is to look like this sRGB colour; of a mesh, its lit side."""
    red, green, blue = np.rint(255 * encoded(_linear(rgb))).astype(int).tolist()
    return red, green, blue


def add_lights(scene: viser.SceneApi) -> None:
    """Instead of viser's own, which leave no colour as it is; these cost less to draw."""
    scene.configure_default_lights(False)
    scene.configure_environment_map(None)
    scene.add_light_ambient("/light/all", intensity=0.8 * BRIGHT)
    scene.add_light_directional("/light/above", intensity=0.25 * BRIGHT)


def decoded(srgb: np.ndarray) -> np.ndarray:
    """sRGB in 0..1 as linear light."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def encoded(linear: np.ndarray) -> np.ndarray:
    """The inverse of decoded."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def _linear(rgb: tuple[int, int, int] | np.ndarray) -> np.ndarray:
    """Linear light that is shown as this sRGB colour, or as near as 0..1 allows."""
    y = decoded(np.asarray(rgb) / 255) @ np.linalg.inv(OUT).T
    # f(v) = (v (v + 0.0245786) - 0.000090537) / (v (0.983729 v + 0.432951) + 0.238081) = y, solved for v
    a, b, c = 1 - 0.983729 * y, 0.0245786 - 0.432951 * y, -0.000090537 - 0.238081 * y
    v = (np.sqrt(b * b - 4 * a * c) - b) / (2 * a)
    return np.clip(EXPOSURE * v @ np.linalg.inv(INTO).T, 0.0, 1.0)
