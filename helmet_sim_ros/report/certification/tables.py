"""A certification as plain data: JSON, CSV, and the scenario of its impacts."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

import yaml

from helmet_sim_ros.study.certification.campaign import Campaign
from helmet_sim_ros.study.certification.certify import CRITERIA, Certification, Row
from helmet_sim_ros.version import __version__

COLUMNS = ("test", "headform", "point", "anvil", "hit", "speed_m_s", "normal_velocity_m_s",
           "tangential_velocity_m_s", "verdict", "margin", "closest", *CRITERIA,
           "largest_strain", "notes")  # fmt: skip


def as_dict(result: Certification) -> dict[str, Any]:
    """Plain JSON types, without histories."""
    protocol = result.campaign.protocol
    worst = result.worst
    return {
        "disclaimer": result.disclaimer,
        "helmet_sim_ros": __version__,
        "helmet": result.campaign.helmet,
        "protocol": result.campaign.name,
        "title": protocol.title,
        "protocol_source": protocol.source,
        "protocol_verified": protocol.verified,
        "verdict": result.verdict,
        "worst_margin": result.worst_margin,
        "worst": worst.hit.name if worst else None,
        "rating": protocol.rating,
        "not_modelled": list(protocol.not_modelled),
        "notes": list(result.notes),
        "rows": [_row(row) for row in result.rows],
    }


def _row(row: Row) -> dict[str, Any]:
    return {
        "test": row.test,
        "headform": row.headform,
        "point": row.point,
        "anvil": row.anvil,
        "hit": row.hit_number,
        "speed": row.speed,
        "normal_velocity": row.normal_velocity,
        "tangential_velocity": row.tangential_velocity,
        "verdict": row.verdict,
        "margin": row.margin,
        "closest": row.closest,
        "azimuth_deg": row.site_deg[0],
        "elevation_deg": row.site_deg[1],
        "values": dict(row.hit.values),
        "largest_strain": row.strain,
        "evaluation": row.evaluation.as_dict(),
        "notes": list(row.notes),
    }


def to_json(result: Certification) -> str:
    """:func:`as_dict` as JSON."""
    return json.dumps(as_dict(result), allow_nan=False, indent=1)


def to_csv(result: Certification) -> str:
    """One line per impact; criteria in their own units."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in result.rows:
        found = row.criteria
        writer.writerow(
            [
                row.test, row.headform, row.point, row.anvil, row.hit_number, row.speed,
                row.normal_velocity, row.tangential_velocity, row.verdict,
                "" if row.margin is None else f"{row.margin:.6g}", row.closest or "",
                *(f"{found[name].value:.8g}" if name in found else "" for name in CRITERIA),
                "" if row.strain is None else f"{row.strain:.6g}", "; ".join(row.notes),
            ]
        )  # fmt: skip
    return text.getvalue()


def to_scenario(campaign: Campaign) -> str:
    """A scenario file of the campaign's first hits, which the nodes can run.

    Later hits on the same spot are left out: an impact of the nodes starts from a new helmet.
    """
    first = [site[0] for site in campaign.sites]
    common = {k: v for k, v in first[0].values.items() if all(h.values.get(k) == v for h in first)}
    cases = [
        {"name": hit.name} | {k: v for k, v in hit.values.items() if k not in common}
        for hit in first
    ]
    left_out = len(campaign.hits) - len(first)
    description = f"Impacts of {campaign.protocol.title}, written from protocol {campaign.name}."
    if left_out:
        description += f" {left_out} later hits on the same spots are left out."
    data = {"description": description, "common": common, "cases": cases}
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=100)
