"""The section of docs/validation.md that holds the foam law against compression data."""

from __future__ import annotations

import numpy as np

from helmet_sim_ros.model.force.foam import RATE, RATE_EXPONENT
from helmet_sim_ros.report.validation.table import table
from helmet_sim_ros.study.validation.foam import FoamReference, density_exponents, foam_findings


def foam_section(reference: FoamReference) -> str:
    """The whole section, with its heading."""
    found = foam_findings(reference)
    parts = [
        "## Foam against compression data\n",
        f"The constants of `model/force/foam.py` stand for {RATE:g} 1/s. *At the test's rate*: "
        f"times (rate / {RATE:g} 1/s)^{RATE_EXPONENT:g}, as in the model. The power was derived "
        "with the static table below, so at 40 kg/m^3 the agreement is no evidence. Data: "
        "`config/references/eps.yaml`.\n",
    ]
    for data in reference.data:
        own = [one for one in found if one.data is data]
        rows = [
            (f"{one.point.density:g}", f"{one.point.strain:g}", f"{one.point.stress / 1e3:.0f}",
             f"{one.law / 1e3:.0f}", f"{one.at_rate / 1e3:.0f}", f"{100 * one.difference:+.0f}")
            for one in own
        ]  # fmt: skip
        header = ("density [kg/m^3]", "strain", "published [kPa]", "law [kPa]",
                  "at the test's rate [kPa]", "difference %")  # fmt: skip
        mean = 100 * float(np.mean([abs(one.difference) for one in own]))
        parts.append(
            f"**{data.name.capitalize()}**, {data.rate:g} 1/s, {data.kind} values "
            f"({data.reading}): {data.source}. Mean difference {mean:.0f} %.\n"
        )
        parts.append(table(header, rows))
    exponents = [
        (name, f"{strain:g}", f"{published:.2f}", f"{law:.2f}")
        for (name, strain), (published, law) in density_exponents(found).items()
    ]
    parts.append("Exponent of the density, fitted through the points of one strain:\n")
    parts.append(table(("data", "strain", "published", "law"), exponents))
    return "\n".join(parts)
