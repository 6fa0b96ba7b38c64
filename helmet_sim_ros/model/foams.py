"""Foams of liners as data: laws by density and tables from tests; read from ``config/foams``."""

from __future__ import annotations

import hashlib

import numpy as np
from pydantic import Field, model_validator

from helmet_sim_ros.config_file import load_config
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.resources import find_config
from helmet_sim_ros.schema import Config, quantity

#: Points of a table from strain 0 to its limit; beyond, the law goes on as a straight line.
POINTS = 64


class Foam(Config):
    """A crushable foam. Stresses are those at ``density`` and follow its powers. Without a table
    (``stress``) the law of :mod:`helmet_sim_ros.model.force.foam` holds; what is unset is EPS's."""

    description: str = Field("", description="what it is")
    source: str = Field("", description="where its numbers come from")
    density: float = quantity("that the values belong to", "kg/m^3", 40.0, ge=10.0, le=300.0)
    densities: tuple[float, float] = quantity("for which it may be used", "kg/m^3")
    solid_density: float | None = quantity("of the polymer", "kg/m^3", None, ge=500.0, le=2000.0)
    yield_stress: float | None = quantity(
        "stress of the plateau, dynamic", "Pa", None, ge=1e3, le=2e7
    )
    rate: float = quantity(
        "strain rate of the tests that the values are from", "1/s", 100.0, ge=1e-5, le=1e4
    )
    rate_exponent: float | None = quantity(
        "power of the strain rate that stresses follow", "-", None, ge=0.0, le=0.3
    )
    yield_exponent: float | None = quantity(
        "power of density that stresses follow", "-", None, ge=0.0, le=3.0
    )
    modulus: float | None = quantity("Young's modulus, dynamic", "Pa", None, ge=1e4, le=1e9)
    gas_pressure: float | None = quantity(
        "of the gas in the cells at the start; 0: open cells", "Pa", None, ge=0.0, le=1e6
    )
    limit: float | None = quantity("last strain of the table", "-", None, ge=0.3, le=0.98)
    stress: tuple[float, ...] | None = Field(
        None, description=f"{POINTS} stresses at equally spaced strains from 0 to limit [Pa]"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Foam:
        low, high = self.densities
        if not 10.0 <= low <= high <= 300.0:
            raise SetupError.of(
                "densities", self.densities, "must be rising, from 10 to 300 kg/m^3"
            )
        if self.stress is not None and self.yield_stress is None:
            raise SetupError.of("yield_stress", None, "is required beside a table")
        if (self.limit is None) != (self.stress is None):
            raise SetupError.of("limit", self.limit, "belongs to a table, stress")
        if self.stress is None:
            return self
        if len(self.stress) != POINTS:
            raise SetupError.of("stress", len(self.stress), f"must be {POINTS} numbers")
        falls = np.flatnonzero(np.diff(self.stress) <= 0.0)
        if self.stress[0] != 0.0 or len(falls):
            raise SetupError.of(
                f"stress[{int(falls[0]) + 1 if len(falls) else 0}]",
                self.stress[int(falls[0]) + 1 if len(falls) else 0],
                "the table must start at 0 and rise",
            )  # fmt: skip
        return self


def load_foam(name_or_path: str) -> Foam:
    """The foam of ``config/foams/NAME.yaml``, or of any YAML file by path.

    Raises:
        SetupError: unknown name, unreadable file, or a refused value in it.
    """
    return load_config(Foam, "foams", name_or_path, "foam")


def foam_digest(name_or_path: str) -> str:
    """First 16 digits of the SHA-256 of a foam's file.

    Raises:
        SetupError: see :func:`load_foam`.
    """
    path = find_config("foams", name_or_path, "foam")
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]
