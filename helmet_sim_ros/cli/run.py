"""Run a scenario through the ROS 2 nodes: progress, table, log."""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from helmet_sim_ros.cli._options import domain_option
from helmet_sim_ros.cli._processes import (
    NODES,
    Nodes,
    start_nodes,
    termination_as_interrupt,
)
from helmet_sim_ros.errors import LogError, NodeError
from helmet_sim_ros.mcap_log.digest import setup_digest
from helmet_sim_ros.mcap_log.writer import PART
from helmet_sim_ros.model.compiled import cache_folder
from helmet_sim_ros.model.fall.setup import Fall
from helmet_sim_ros.nodes.client import call, ros_client, wait_for_service
from helmet_sim_ros.nodes.environment import prepare_environment
from helmet_sim_ros.resources import is_path
from helmet_sim_ros.study.scenario.matrix import Case, Scenario

#: Values of a setup that name a file or something shipped.
FILE_VALUES = (
    "helmet.name", "helmet.geometry", "helmet.liner.foam", "impact.surface", "head.surface",
    "head.form", "fall.preset", "fall.scene",
)  # fmt: skip
#: How long the nodes may take until they answer [s]; a loaded machine needs a few, and the very
#: first start compiles.
START_TIMEOUT = 180.0


@click.command()
@click.argument("scenario")
@click.option("--output", default="logs", show_default=True, metavar="DIR",
              type=click.Path(path_type=Path), help="Where the log goes.")  # fmt: skip
@click.option("--override", "-o", "overrides", multiple=True, metavar="KEY=VALUE",
              help="Replace a value in every case, e.g. impact.friction=0.3, helmet=fullface or "
              "helmet.liner.density=60.")  # fmt: skip
@click.option("--standard", help="Judge by config/standards/NAME.yaml or a path.  [default: "
              "ECE R22.05]")  # fmt: skip
@click.option("--all-criteria", is_flag=True, help="Show every criterion of every case.")
@click.option("--one-process/--four-processes", default=True, show_default=True,
              help="All nodes in this process, or each in a process of its own.")  # fmt: skip
@domain_option
def command(
    scenario: str,
    output: Path,
    overrides: tuple[str, ...],
    standard: str | None,
    all_criteria: bool,
    one_process: bool,
    domain_id: int | None,
) -> None:
    """Run every case of SCENARIO, a name in config/scenarios or a path to a YAML file.

    Exit code 0: every case was evaluated; 1: not all; 2: bad input, nothing was started.
    """
    from helmet_sim_ros.study import load_scenario
    from helmet_sim_ros.study.scenario.overrides import parse_overrides

    console = Console(highlight=False)
    plan = load_scenario(scenario, overrides=parse_overrides(overrides))
    console.print(f"[bold]{plan.name}[/bold]: {counted(plan)}; starting the nodes")
    if not any(cache_folder().rglob("*.nbi")):
        console.print("the first run compiles the model: a minute or two without a sign of life")
    check_writable(output)
    from helmet_sim_ros.biomech.standards import DEFAULT_STANDARD, load_standard  # slow to import

    load_standard(standard or DEFAULT_STANDARD)

    prepare_environment(domain_id)
    # The nodes open no file because a client names it, except these.
    named = named_files(case.setup.described() for case in plan.cases)
    paths: dict[str, Any] = {"config_paths": named} if named else {}
    kind = "fall" if isinstance(plan.cases[0].setup, Fall) else "impact"
    parameters: dict[str, dict[str, Any]] = {
        # The kind of the first case: its code is made ready while the node starts.
        "simulation": paths | {"sim.kind": kind},
        "evaluator": paths | {"standard": standard or ""},
        "recorder": paths | {"output_dir": str(output.resolve())},
        "scenario": {
            "scenario.file": str(plan.path.resolve()),
            "scenario.overrides": list(overrides) or [""],
        },
    }
    began = time.monotonic()
    # A name of our own: the answer must not come from a scenario node that somebody else started.
    run = f"scenario/run_{os.getpid()}"
    remaps = {"scenario": {"~/run": run}}
    with termination_as_interrupt(), start_nodes(one_process, parameters, remaps) as nodes:
        result = run_scenario(nodes, run, len(plan.cases), console)
        check_asked(result, plan.cases)
        report(result, console, all_criteria, time.monotonic() - began)
        nodes.exit_code = 0 if result["complete"] else 1
    if plan.falls:
        write_strikes(result, output / plan.name, console)
    if not result["complete"]:
        raise SystemExit(1)


def counted(plan: Scenario) -> str:
    """How many impacts and falls there are, in words."""
    falls = len(plan.falls)
    counts = ((len(plan.cases) - falls, "impact"), (falls, "fall"))
    return " and ".join(f"{count} {what}{'s' * (count > 1)}" for count, what in counts if count)


def named_files(setups: Iterable[Mapping[str, Any]]) -> list[str]:
    """The files that described setups name, those of their helmets too, as absolute paths."""
    chosen = {values.get(name) for values in setups for name in FILE_VALUES}
    files = (name for name in chosen if name is not None and is_path(name))
    return sorted(str(Path(name).expanduser().resolve()) for name in files)


def run_scenario(nodes: Nodes, service: str, cases: int, console: Console) -> dict[str, Any]:
    """Trigger the scenario node by its service and follow it; its result as plain data.

    Raises:
        NodeError: a node does not come up, ends, or refuses.
    """
    with ros_client() as node:
        from std_msgs.msg import String
        from std_srvs.srv import Trigger

        columns = (
            TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
            TextColumn("left"), TimeRemainingColumn(),
        )  # fmt: skip
        with Progress(*columns, console=console, transient=True) as progress:
            task = progress.add_task("starting", total=cases)

            def follow(message: Any) -> None:
                state = json.loads(message.data)
                progress.update(
                    task, completed=state["done"], description=state["case"] or state["state"]
                )

            node.create_subscription(String, "scenario/progress", follow, 10)
            run = node.create_client(Trigger, service)

            def tick() -> None:
                nodes.check()
                check_alone(node)

            wait_for_service(node, run, START_TIMEOUT, tick)
            answer = call(node, run, Trigger.Request(), float("inf"), tick)
        try:
            result: dict[str, Any] = json.loads(answer.message)
        except ValueError:
            raise NodeError(f"the scenario was refused: {answer.message}") from None
        return result


def check_asked(result: dict[str, Any], cases: Sequence[Case]) -> None:
    """Let no row count whose impact is not the one asked for, or whose log is not there."""
    from helmet_sim_ros.nodes.scenario_node import not_asked

    rows = result["cases"]
    if len(rows) != len(cases):
        result["error"] = f"{len(rows)} cases were run, {len(cases)} were asked for"
    for row, case in zip(rows, cases, strict=False):
        asked, ran, log = setup_digest(case.setup.described()), row["setup_digest"], row["recorded"]
        if row["status"] != "evaluated":
            continue
        if ran != asked:
            row["error"] = not_asked(row["impact_id"], ran, asked)
        elif log and not any(Path(log + suffix).is_file() for suffix in ("", PART)):
            row["error"] = f"its log {log} was there and is gone"
        if row["error"]:
            row |= {"status": "failed", "evaluation": None, "strikes": None}
    failed = any(row["status"] != "evaluated" for row in rows)
    result["complete"] = result["complete"] and not failed and not result["error"]


def check_alone(node: Any) -> None:
    """Refuse to run where others of the same names would answer too.

    Raises:
        NodeError: another simulation is up in this ROS domain.
    """
    there = [f"{namespace.rstrip('/')}/{name}" for name, namespace in
             node.get_node_names_and_namespaces()]  # fmt: skip
    twice = [name for name in NODES if there.count(f"/{name}") > 1]
    if twice:
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        raise NodeError(
            f"another /{twice[0]} is up in ROS domain {domain} (helmet-sim up?); end it, or choose "
            "a domain: --domain-id"
        )


def report(result: dict[str, Any], console: Console, all_criteria: bool, seconds: float) -> None:
    """Print the tables, what failed and why, and where the log is."""
    from helmet_sim_ros.cli._console import print_table
    from helmet_sim_ros.cli._table import criteria_table, result_table

    rows = result["cases"]
    falls = [row for row in rows if row.get("strikes") is not None]
    impacts = [row for row in rows if row.get("strikes") is None]
    if impacts:
        print_table(console, result_table(impacts, result["scenario"]))
    if falls:
        from helmet_sim_ros.cli._falls import strike_rows, strikes_table

        print_table(
            console, strikes_table([(row["name"], strike_rows(row["strikes"])) for row in falls])
        )
    if any(row.get("reference") for row in rows):
        console.print(f"Published values: {result['reference']}", style="dim", markup=False)
    if all_criteria:
        for name, evaluation in judged(rows):
            print_table(console, criteria_table({"name": name, "evaluation": evaluation}))
    for row in rows:
        for name, evaluation in judged([row]):
            for message in failures(evaluation):
                console.print(f"{name}: {message}", style="yellow", markup=False, soft_wrap=True)
            for warning in evaluation["warnings"]:
                console.print(f"{name}: {warning}", style="dim", markup=False, soft_wrap=True)
        if row["status"] != "evaluated":
            text = f"{row['name']}: {row['status']}: {row['error']}"
            console.print(text, style="red", markup=False, soft_wrap=True)
    if result["error"]:
        console.print(result["error"], style="red")
    logs = dict.fromkeys([*(row["recorded"] for row in rows), result["file"]])
    for path in filter(None, logs):
        console.print(f"log: {os.path.relpath(path)}", soft_wrap=True)
    evaluated = sum(row["status"] == "evaluated" for row in rows)
    what = "falls" if falls and not impacts else "cases" if falls else "impacts"
    console.print(f"{evaluated} of {len(rows)} {what} evaluated in {seconds:.1f} s")


def judged(rows: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Name and evaluation of every impact, and of every head strike of falls."""
    for row in rows:
        if row["status"] != "evaluated":
            continue
        if row.get("strikes") is None:
            yield row["name"], row["evaluation"]
        for number, strike in enumerate(row.get("strikes") or (), 1):
            yield f"{row['name']}, strike {number}", strike["evaluation"]


def failures(evaluation: Mapping[str, Any]) -> list[str]:
    """What failed and by how much, in plain language."""
    failed = sum(entry["verdict"] == "fail" for entry in evaluation["criteria"].values())
    return list(evaluation["messages"][:failed])  # failures stand first


def write_strikes(result: Mapping[str, Any], folder: Path, console: Console) -> None:
    """Write page, table and scenario of the head strikes in a log into a folder.

    Raises:
        LogError: the log cannot be read, or a file cannot be written.
    """
    from helmet_sim_ros.mcap_log import open_log
    from helmet_sim_ros.report.falls.logged import results_of
    from helmet_sim_ros.report.falls.page import write_falls

    names = {row["impact_id"]: row["name"] for row in result["cases"]}
    paths = dict.fromkeys(row["recorded"] for row in result["cases"] if row["recorded"])
    found = [fall for path in paths for fall in results_of(open_log(path), names)]
    for path in write_falls(found, folder, None):
        console.print(os.path.relpath(path), soft_wrap=True, markup=False)


def check_writable(folder: Path) -> None:
    """Create the output directory if it is missing, and refuse one that cannot be written.

    Raises:
        LogError: it cannot be created, or no file can be written in it.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise LogError(f"--output {folder}: cannot be written: {error.strerror}") from error
