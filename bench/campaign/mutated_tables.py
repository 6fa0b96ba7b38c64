"""CSV tables of drop tests and published results, mutated: read, or refused by row and column."""

from __future__ import annotations

import random
from pathlib import Path

from bench.campaign.attack import Attack, Outcome
from helmet_sim_ros.errors import HelmetSimError
from helmet_sim_ros.resources import share_directory
from helmet_sim_ros.study import load_reference
from helmet_sim_ros.study.identification.drop_table import read_drop_table

PEAKS = (
    "direction,normal_velocity_m_s,peak_force_N,peak_compression_m,restitution,energy_loss,peak_g\n"
    "front,2.5,4000,0.010,0.3,0.6,80\nfront,5.0,9000,0.018,,,\nback,7.5,15000,0.024,0.3,nan,210\n"
)
LOOPS = "direction,normal_velocity_m_s,force_N,compression_m\n" + "".join(
    f"top,5.0,{force},{compression}\n"
    for compression, force in ((0, 0), (0.005, 2000), (0.01, 6000), (0.015, 9000), (0.012, 900))
)
VALUES = ["", " ", "nan", "inf", "-inf", "1e400", "-1", "0", "1e-300", "x", "1_0", "0x10", "1,5",
          '"', '"a""b"', "front ", "FRONT", "bottom", "=1+1", "\x00", "\x1b[2J", "\u202e", "\ufeff",
          "é" * 200, "1" * 400, "9" * 200_000, "1" * 5000, "\r", "\t", "١", "#", "# x"]  # fmt: skip


class MutatedTables(Attack):
    """A mutated table is read, or refused by an error of ours, at once and with little memory."""

    name = "mutated tables"
    what = "drop tests and published results as CSV with changed cells, rows, columns and bytes"
    cases = (1000, 10_000)

    def prepare(self, folder: Path) -> None:
        references = share_directory() / "config" / "references"
        published = [path.read_text() for path in sorted(references.glob("*.csv"))]
        self._texts = [("drops", PEAKS), ("drops", LOOPS), *(("reference", p) for p in published)]
        self._place = folder / "mutated.csv"

    def case(self, rng: random.Random) -> Outcome:
        kind, text = rng.choice(self._texts)
        for _ in range(rng.choice([1, 1, 2, 4])):
            text = _mutated(text, rng)
        data = text.encode("utf-8", "surrogateescape")
        if rng.random() < 0.1:
            at = rng.randrange(len(data) + 1)
            data = data[:at] + rng.randbytes(rng.randrange(1, 5)) + data[at:]
        self._place.write_bytes(data)
        try:
            if kind == "drops":
                read_drop_table(self._place)
            else:
                load_reference(str(self._place))
        except HelmetSimError as error:
            message = str(error)
            if not message.replace("\n", "").isprintable() or len(message) > 5000:
                return Outcome("lost", f"{kind}: a message that cannot be shown: {message[:200]!r}")
            return Outcome("refused", f"{kind}: {message}")
        return Outcome("held", kind)


def _mutated(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    i = rng.randrange(len(lines))
    cells = lines[i].split(",")
    k = rng.randrange(len(cells))
    how = rng.randrange(8)
    if how < 3:
        cells[k] = rng.choice(VALUES)
    elif how == 3:
        cells.insert(k, rng.choice(VALUES))
    elif how == 4:
        del cells[k]
    elif how == 5:
        return "\n".join(rng.sample(lines, len(lines)))
    elif how == 6:
        return text[: rng.randrange(len(text) + 1)]
    else:
        lines.insert(i, lines[rng.randrange(len(lines))])
        return "\n".join(lines)
    lines[i] = ",".join(cells)
    return "\n".join(lines)
