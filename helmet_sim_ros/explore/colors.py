"""The colours of the explorer: of the two sides, of what is drawn, and of crush."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.explore.session import Side
from helmet_sim_ros.model.scene import SceneShape

RGB = tuple[int, int, int]

#: Colour of each side in charts and tables, and of its helmet.
SIDE_COLORS: dict[Side, RGB] = {"A": (31, 98, 184), "B": (222, 120, 24)}
#: A second colour beside it, where a chart has two curves of one side.
SIDE_TINTS: dict[Side, RGB] = {"A": (110, 170, 230), "B": (240, 180, 110)}

SURFACE_COLOR: RGB = (168, 164, 158)

_SKIN: RGB = (214, 172, 148)
_SUIT: dict[Side, RGB] = {"A": (122, 134, 150), "B": (158, 146, 130)}
_LEATHER: RGB = (62, 64, 72)
#: Scale of crush from none to most: white, yellow, red, dark red.
_CRUSH = np.array([[255, 245, 220], [254, 196, 79], [227, 74, 51], [127, 0, 0]], dtype=float)


def css(color: RGB) -> str:
    """``#1f62b8``."""
    return "#" + "".join(f"{part:02x}" for part in color)


def rgb(color: tuple[float, ...]) -> RGB:
    """From shares of 1."""
    r, g, b = (round(255 * part) for part in color[:3])
    return r, g, b


def shape_color(shape: SceneShape, side: Side) -> RGB:
    """A rider in a suit with gloves and boots, and his helmet in the colour of the side."""
    if shape.name == "helmet":
        return SIDE_COLORS[side]
    if shape.name == "head":
        return _SKIN
    if shape.name.startswith(("hand", "foot")):
        return _LEATHER
    return _SUIT[side]


def crush_colors(share: FloatArray) -> NDArray[np.uint8]:
    """Colours (n, 3) of crush as a share (n,) of the largest."""
    at = np.linspace(0.0, 1.0, len(_CRUSH))
    colors = np.column_stack([np.interp(share, at, column) for column in _CRUSH.T])
    return colors.round().astype(np.uint8)
