"""What the impacts of a log have in common and in what they differ, in words and short tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from helmet_sim_ros.present.words import value_text

Setup = Mapping[str, object]

#: Setup values that every table shows.
LEADING = ("impact.direction", "impact.normal_velocity", "impact.tangential_velocity")
#: Setup values that only say what others say already.
FOLLOWING = ("helmet.description", "impact.neck_flexion_deg")
#: Setup values that name the impacts of a log shortly; all others are on request.
SHORT = (
    "impact.rig", "impact.surface", "helmet.name", "helmet.coupling", "impact.body_angle_deg",
    "impact.tangential_heading_deg", "impact.friction", "impact.gravity", "rider.height",
    "rider.mass", "sim.duration", "sim.time_step",
)  # fmt: skip


def label(setup: Setup) -> str:
    """``left, 5 m/s, 10 m/s along the ground``; ``surface`` where that is another one; of a fall
    ``motorcycle, 10 m/s, road``."""
    if LEADING[0] not in setup and "fall.preset" in setup:
        preset, speed, scene = (setup.get(f"fall.{n}") for n in ("preset", "speed", "scene"))
        return f"{preset}, {value_text(speed)} m/s, {scene}"
    direction, normal, tangential = (setup.get(name) for name in LEADING)
    parts = [str(direction or "impact")]
    if isinstance(normal, int | float):
        parts.append(f"{normal:g} m/s")
    if isinstance(tangential, int | float) and tangential:
        struck = "ground" if setup.get("impact.surface", "ground") == "ground" else "surface"
        parts.append(f"{tangential:g} m/s along the {struck}")
    return ", ".join(parts)


def varying(setups: Sequence[Setup]) -> list[str]:
    """Names of the values in which setups differ, the order is that of the first setup; without the
    state of a replayed head strike, a list that no table can show."""
    names = dict.fromkeys(n for setup in setups for n in setup if n != "impact.state")
    return [n for n in names if any(s.get(n) != setups[0].get(n) for s in setups)]


def common(setups: Sequence[Setup]) -> dict[str, object]:
    """The values that all setups share."""
    first = setups[0] if setups else {}
    return {k: v for k, v in first.items() if all(s.get(k) == v for s in setups)}


def labels(setups: Sequence[Setup], speeds: bool = True) -> list[str]:
    """A label for each setup: direction, speeds, and up to four other values that differ."""
    more = [n for n in varying(setups) if n not in (*LEADING, *FOLLOWING)][:4]
    last = [n.rpartition(".")[2] for n in more]
    words = [
        w if last.count(w) == 1 else n.replace(".", " ") for n, w in zip(more, last, strict=True)
    ]
    names = []
    for setup in setups:
        first = label(setup) if speeds else str(setup.get(LEADING[0]) or "impact")
        extra = [f"{w} {value_text(setup.get(n))}" for n, w in zip(more, words, strict=True)]
        names.append("; ".join([first, *extra]))
    return names
