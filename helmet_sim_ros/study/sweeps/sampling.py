"""Space-filling draws: points of the unit cube, and what distributions make of them."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from helmet_sim_ros.biomech.record import FloatArray
from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.schema import Config, Leaf

Method = Literal["sobol", "latin_hypercube", "random"]

#: SciPy's Sobol generator has direction numbers for so many dimensions.
MAX_SOBOL_DIMENSIONS = 21201


class Distribution(Config):
    """How one value is drawn: one of uniform, log_uniform, normal and choice."""

    uniform: tuple[float, float] | None = Field(None, description="lowest and highest value")
    log_uniform: tuple[float, float] | None = Field(
        None, description="lowest and highest value; the logarithm is uniform"
    )
    normal: tuple[float, float] | None = Field(
        None, description="mean and standard deviation, cut off outside 'within'"
    )
    within: tuple[float, float] | None = Field(
        None, description="bounds of 'normal'; unset: the range of the value itself"
    )
    choice: tuple[object, ...] | None = Field(None, description="values of equal probability")

    @model_validator(mode="after")
    def _plausible(self) -> Distribution:
        kinds = [k for k in ("uniform", "log_uniform", "normal", "choice") if getattr(self, k)]
        if self.choice == ():
            raise SetupError.of("choice", [], "must hold at least one value")
        if len(kinds) != 1:
            raise SetupError.of(
                "(distribution)", kinds, "give one of uniform, log_uniform, normal, choice"
            )
        for name in ("uniform", "log_uniform", "within"):
            bounds = getattr(self, name)
            if bounds is not None and not bounds[0] < bounds[1]:
                raise SetupError.of(name, list(bounds), "empty range: the first must be the lower")
        if self.log_uniform is not None and self.log_uniform[0] <= 0.0:
            raise SetupError.of("log_uniform", list(self.log_uniform), "must be above 0")
        if self.normal is not None and self.normal[1] <= 0.0:
            raise SetupError.of(
                "normal", list(self.normal), "the standard deviation must be above 0"
            )
        if self.within is not None and self.normal is None:
            raise SetupError.of("within", list(self.within), "goes with normal only")
        return self

    def check(self, leaf: Leaf) -> None:
        """Refuse a distribution that does not fit the value it is for.

        Raises:
            SetupError: numbers for what is no number, or a range beyond the value's own.
        """
        if self.choice is not None:
            return
        if leaf.type not in (float, int):
            raise SetupError.of(leaf.name, self._given(), f"{leaf.allowed}; draw it by choice")
        low, high = self._bounds(leaf)
        below = leaf.minimum is not None and low < leaf.minimum
        below |= leaf.exclusive_minimum and low == leaf.minimum
        above = leaf.maximum is not None and high > leaf.maximum
        if below or above:
            raise SetupError.of(leaf.name, self._given(), leaf.allowed)
        if self.normal is not None and not _probability(self.normal, low, high) > 1e-6:
            raise SetupError.of(leaf.name, self._given(), "hardly any of it lies in the range")

    def values(self, unit: FloatArray, leaf: Leaf | None = None) -> list[object]:
        """The values at quantiles ``unit``, shape (n,), each in [0, 1)."""
        if self.choice is not None:
            picks = np.minimum((unit * len(self.choice)).astype(int), len(self.choice) - 1)
            return [self.choice[i] for i in picks]
        low, high = self._bounds(leaf)
        if self.normal is not None:
            from scipy.special import ndtr, ndtri

            mean, deviation = self.normal
            first, last = ndtr((low - mean) / deviation), ndtr((high - mean) / deviation)
            drawn = mean + deviation * ndtri(first + unit * (last - first))
        elif self.log_uniform is not None:
            drawn = low * (high / low) ** unit
        elif leaf is not None and leaf.type is int:
            drawn = np.floor(low + unit * (high - low + 1.0))
        else:
            drawn = low + unit * (high - low)
        drawn = np.clip(drawn, low, high)
        if leaf is not None and leaf.type is int:
            return [round(x) for x in drawn.tolist()]
        return list(drawn.tolist())

    def _bounds(self, leaf: Leaf | None) -> tuple[float, float]:
        given = self.uniform or self.log_uniform or self.within
        if given is not None:
            return given
        low = None if leaf is None else leaf.minimum
        high = None if leaf is None else leaf.maximum
        if low is not None and leaf is not None and leaf.exclusive_minimum:
            low = math.nextafter(low, math.inf)
        return (-math.inf if low is None else low), (math.inf if high is None else high)

    def _given(self) -> dict[str, object]:
        return {k: v for k, v in self.model_dump().items() if v is not None}


def unit_points(method: Method, count: int, dimensions: int, seed: int) -> NDArray[np.float64]:
    """``count`` points in the unit cube, shape (count, dimensions), the same for the same seed.

    ``sobol`` (scrambled) needs a power of 2: any other number of points loses its balance.

    Raises:
        SetupError: ``sobol`` with another count.
    """
    if method == "random":
        return np.random.default_rng(seed).random((count, dimensions))
    from scipy.stats import qmc

    if method == "latin_hypercube":
        return np.asarray(qmc.LatinHypercube(dimensions, rng=seed).random(count))
    if count & (count - 1):
        near = 2 ** round(math.log2(count))
        raise SetupError.of("count", count, f"must be a power of 2 with sobol, for example {near}")
    return np.asarray(qmc.Sobol(dimensions, scramble=True, rng=seed).random(count))


def _probability(normal: tuple[float, float], low: float, high: float) -> float:
    from scipy.special import ndtr

    mean, deviation = normal
    return float(ndtr((high - mean) / deviation) - ndtr((low - mean) / deviation))
