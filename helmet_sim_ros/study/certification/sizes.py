"""A helmet in another size: made anew around another headform."""

from __future__ import annotations

import math

import numpy as np

from helmet_sim_ros.errors import SetupError
from helmet_sim_ros.model.headform import Headform, load_headform
from helmet_sim_ros.model.helmet import Helmet
from helmet_sim_ros.study.optimisation.design import DesignRules, bare_mass


def remade(helmet: Helmet, own: str, other: str) -> dict[str, object]:
    """What of a helmet changes when it is made for another headform.

    Liner, padding and shell keep their thickness and material, and the head its room: the shell
    grows on every side by the difference of the circumferences over 2 pi. Liner and shell weigh by
    their volume and area (see :mod:`helmet_sim_ros.study.optimisation.design`), straps and visor
    stay; the moments of inertia follow mass and size. Makers do it so within one shell size; they
    may also put another liner into the same shell, which is another helmet file here.

    Args:
        helmet: made for the headform ``own``.
        own: name in ``config/headforms``, or path.
        other: the headform to fit.

    Returns:
        Dotted names below ``helmet.``; empty where the headforms are as large as each other.

    Raises:
        SetupError: a headform without circumference, or a helmet that cannot be made.
    """
    growth = (_around(load_headform(other), other) - _around(load_headform(own), own)) / math.tau
    if growth == 0.0:
        return {}
    axes = np.array(helmet.shell.semi_axes)
    shell = {"shell.semi_axes": tuple((axes + growth).tolist())}
    grown: Helmet = helmet.replaced(shell)
    rules = DesignRules()
    mass = helmet.mass + bare_mass(grown, rules) - bare_mass(helmet, rules)
    scale = mass / helmet.mass * float(np.mean(axes + growth) / np.mean(axes)) ** 2
    return {**shell, "mass": mass, "inertia": tuple(scale * i for i in helmet.inertia)}


def _around(form: Headform, name: str) -> float:
    if form.circumference is None:
        raise SetupError.of(
            "headform", name, "has no circumference, so no helmet can be made around it"
        )
    return form.circumference.value
