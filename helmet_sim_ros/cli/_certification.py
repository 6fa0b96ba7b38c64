"""What a certification campaign found, as a table."""

from __future__ import annotations

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from helmet_sim_ros.cli._console import print_table
from helmet_sim_ros.cli._table import VERDICT_STYLE
from helmet_sim_ros.study.certification.certify import Certification

#: Shown of every impact: criterion, header, format, factor from the criterion's unit.
SHOWN = (
    ("peak_g_cfc1000", "peak g", ".0f", 1.0),
    ("hic_cfc1000", "HIC", ".0f", 1.0),
    ("peak_angular_acceleration_cfc1000", "krad/s2", ".1f", 1e-3),
    ("bric", "BrIC", ".2f", 1.0),
    ("dwell_150g_cfc1000", "ms>150g", ".1f", 1e3),
)
#: Shown even where the protocol does not limit them; all others only where it does.
ALWAYS = ("peak_g_cfc1000",)


def report(result: Certification, console: Console) -> None:
    """Print verdict per impact, worst margin and what a reader should know."""
    protocol = result.campaign.protocol
    console.print(result.disclaimer, style="yellow", markup=False)
    table = Table(
        title=f"{result.campaign.helmet}: {protocol.title}", box=box.SIMPLE_HEAD,
        title_justify="left", pad_edge=False, padding=(0, 1, 0, 0),
    )  # fmt: skip
    limited = {name for row in result.rows for name, c in row.criteria.items() if c.limit}
    shown = [entry for entry in SHOWN if entry[0] in limited or entry[0] in ALWAYS]
    again = any(row.hit_number > 1 for row in result.rows)
    sized = any(row.hit.size for row in result.rows)
    for header in ("headform", "point", "anvil") if sized else ("point", "anvil"):
        table.add_column(header, no_wrap=True)
    for header in ("m/s", "hit") if again else ("m/s",):
        table.add_column(header, justify="right", no_wrap=True)
    for _, header, _, _ in shown:
        table.add_column(Text(header), justify="right", no_wrap=True)
    table.add_column("strain", justify="right", no_wrap=True)
    table.add_column("margin", justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    test = ""
    for row in result.rows:
        if row.test != test:
            test = row.test
            table.add_section()
            table.add_row(Text(test, style="bold", no_wrap=False))
        cells = [
            format(row.criteria[name].value * factor, style) if name in row.criteria else ""
            for name, _, style, factor in shown
        ]
        margin = "" if row.margin is None else f"{row.margin:.1%}"
        table.add_row(
            *((row.headform,) if sized else ()), row.point, row.anvil,
            f"{row.speed:g}", *((str(row.hit_number),) if again else ()),
            *cells,
            "" if row.strain is None else f"{row.strain:.2f}", margin,
            Text(row.verdict, style=VERDICT_STYLE.get(row.verdict, "")),
        )  # fmt: skip
    print_table(console, table)
    for note in result.notes:
        console.print(f"- {note}", markup=False, style="dim")
    for text in protocol.not_modelled:
        console.print(f"- not modelled: {text}", markup=False, style="dim")
    if protocol.rating:
        console.print(protocol.rating, markup=False)
    worst = result.worst
    verdict_text = Text(result.verdict.upper(), style=VERDICT_STYLE.get(result.verdict, ""))
    if worst is not None:
        verdict_text.append(f"  worst margin {worst.margin:.1%}: {worst.hit.name}, {worst.closest}")
    console.print(verdict_text)
