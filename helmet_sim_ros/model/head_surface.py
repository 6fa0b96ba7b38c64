"""The surface of a head in its helmet, of skin or metal; read from ``config/head_surfaces``."""

from __future__ import annotations

from pydantic import Field

from helmet_sim_ros.config_file import load_config
from helmet_sim_ros.schema import Config, quantity


class HeadSurface(Config):
    """Friction of a head in a helmet's liner, and the compliance of what covers the skull."""

    description: str = Field("", description="what it represents")
    source: str = Field("", description="where its numbers come from")
    friction: float = quantity("friction in the liner", "-", ge=0.0, le=2.0)
    thickness: float = quantity(
        "of the layer that shears over the skull; 0: bare", "m", 0.0, ge=0.0, le=0.03
    )
    shear_modulus: float | None = quantity(
        "of that layer; unset: rigid", "Pa", None, ge=1e3, le=1e9
    )


class Head(Config):
    """The head in its helmet."""

    form: str | None = Field(
        None,
        description="what takes the place of the head with rig headform: name in config/headforms, "
        "or path to a YAML file; unset: the rider's own head",
    )
    surface: str | None = Field(
        None,
        description="surface of the head in the liner: name in config/head_surfaces, or path to a "
        "YAML file; unset: that of the headform; scalp for a rider, else en960",
    )
    friction: float | None = quantity(
        "friction of head in liner; unset: that of the surface", "-", None, ge=0.0, le=2.0
    )


def load_head_surface(name_or_path: str) -> HeadSurface:
    """The surface of ``config/head_surfaces/NAME.yaml``, or of any YAML file by path.

    Raises:
        SetupError: unknown name, unreadable file, or a refused value in it.
    """
    return load_config(HeadSurface, "head_surfaces", name_or_path, "head.surface")
