"""The command: run the attacks and print one table."""

from __future__ import annotations

import shlex
import signal
import tempfile
import time
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

from bench.campaign.attack import VERDICTS, Attack, Tally, run
from bench.campaign.damaged_logs import DamagedLogs
from bench.campaign.garbage_blocks import GarbageBlocks
from bench.campaign.hostile_names import HostileNames
from bench.campaign.interrupted_logs import InterruptedLogs
from bench.campaign.mutated_tables import MutatedTables
from bench.campaign.mutated_yaml import MutatedYaml
from bench.campaign.parameter_sets import ParameterSets
from bench.campaign.running.bad_readers import BadReaders
from bench.campaign.running.clock_jumps import ClockJumps
from bench.campaign.running.concurrent_clients import ConcurrentClients
from bench.campaign.running.forged_blocks import ForgedBlocks
from bench.campaign.running.full_disk import FullDisk
from bench.campaign.running.killed_commands import KilledCommands
from bench.campaign.running.killed_nodes import KilledNodes
from bench.campaign.running.lost_folders import LostFolders
from bench.campaign.running.separate_processes import SeparateProcesses
from bench.campaign.running.stopped_nodes import StoppedNodes
from bench.campaign.running.sweeps import KilledSweeps, TwoSweeps

ATTACKS: tuple[type[Attack], ...] = (
    DamagedLogs, InterruptedLogs, MutatedYaml, MutatedTables, ParameterSets, GarbageBlocks,
    HostileNames, SeparateProcesses, KilledNodes, KilledCommands, StoppedNodes, ConcurrentClients,
    ForgedBlocks, BadReaders, FullDisk, LostFolders, ClockJumps, KilledSweeps, TwoSweeps,
)  # fmt: skip
#: Bad cases whose details are printed, per attack.
MOST_DETAILS = 10


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--only", multiple=True, type=click.Choice([a.name for a in ATTACKS]),
              help="This attack, repeatable.")  # fmt: skip
@click.option("--seed", default=1, show_default=True)
@click.option("--long", "is_long", is_flag=True, help="Hours instead of minutes.")
@click.option("--cases", type=click.IntRange(1), help="So many of each attack.")
@click.option("--case", "number", type=click.IntRange(0), help="This one only, with its detail.")
@click.option("--list", "is_list", is_flag=True, help="Say what the attacks are.")
def main(
    only: tuple[str, ...], seed: int, is_long: bool, cases: int | None, number: int | None,
    is_list: bool,
) -> None:  # fmt: skip
    """Attack and count. Exit code 1: something was lost or failed."""
    # A shell has what it starts in the background ignore Ctrl-C, and so would all that is started.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    console = Console(highlight=False, soft_wrap=True)
    chosen = [attack for attack in ATTACKS if not only or attack.name in only]
    if is_list:
        for attack in chosen:
            console.print(f"{attack.name}: {attack.what}", markup=False)
        return
    tallies = []
    with tempfile.TemporaryDirectory() as folder:
        for attack in chosen:
            count = cases or attack.cases[is_long]
            numbers = range(count) if number is None else range(number, number + 1)
            began = time.monotonic()
            tally = run(attack(), seed, numbers, Path(folder, attack.name.replace(" ", "_")))
            tallies.append(tally)
            wall = time.monotonic() - began
            console.print(
                f"{tally.attack}: {tally.words} in {wall:.0f} s, the slowest took "
                f"{tally.slowest:.2f} s of processor time", markup=False,
            )  # fmt: skip
            if number is not None and tally.last is not None:
                console.print(f"  {tally.last.verdict}: {tally.last.detail}", markup=False)
            else:
                _show_bad(console, tally, seed)
    console.print(f"seed {seed}", _table(tallies), sep="\n")
    raise SystemExit(any(tally.bad for tally in tallies))


def _show_bad(console: Console, tally: Tally, seed: int) -> None:
    for number, outcome in tally.bad[:MOST_DETAILS]:
        line = f"--only {shlex.quote(tally.attack)} --seed {seed} --case {number}"
        console.print(f"  {outcome.verdict}: {outcome.detail}", markup=False)
        console.print(f"    python -m bench.campaign {line}", markup=False)


def _table(tallies: list[Tally]) -> Table:
    table = Table("test", title="Attacks")
    for column in ("count", *VERDICTS):
        table.add_column(column, justify="right")
    for tally in tallies:
        if tally.skipped:
            table.add_row(tally.attack, "skipped", *("" for _ in VERDICTS))
            continue
        counts = [tally.counts[verdict] for verdict in VERDICTS]
        table.add_row(tally.attack, *map(str, (sum(counts), *counts)))
    return table


if __name__ == "__main__":
    main()
