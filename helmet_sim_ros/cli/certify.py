"""Strike a helmet with everything that a test house's protocol asks for, and judge it."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console

from helmet_sim_ros.cli._progress import shown_progress


@click.command()
@click.argument("helmet")
@click.option("--protocol", required=True, metavar="NAME",
              help="Name in config/protocols, or path to a YAML file.")  # fmt: skip
@click.option("-o", "--output", metavar="DIR", type=click.Path(path_type=Path),
              help="Write certification.csv, .json and .html there.")  # fmt: skip
@click.option("--scenario", metavar="FILE", type=click.Path(path_type=Path),
              help="Write the impacts as a scenario for helmet-sim run, and stop.")  # fmt: skip
@click.option("--headform", "headforms", multiple=True, metavar="NAME|all",
              help="Size to test, repeatable; 'all': every size of the protocol. The helmet is "
              "made anew for each.  [default: the size of its file]")  # fmt: skip
@click.option("--override", "overrides", multiple=True, metavar="KEY=VALUE",
              help="Replace a value in every impact, e.g. helmet.liner.density=60.")  # fmt: skip
@click.option("--workers", type=click.IntRange(1), metavar="N",
              help="Impacts at the same time.  [default: one per core]")  # fmt: skip
def command(
    helmet: str,
    protocol: str,
    output: Path | None,
    scenario: Path | None,
    headforms: tuple[str, ...],
    overrides: tuple[str, ...],
    workers: int | None,
) -> None:
    """Certify HELMET, a name in config/helmets or a path to a YAML file, by simulation.

    This is a simulation and no approval.

    Exit code 0: every limit is kept (or the protocol has none); 1: a limit is exceeded; 2: bad
    input, nothing was computed.
    """
    from helmet_sim_ros.cli._certification import report
    from helmet_sim_ros.errors import LogError
    from helmet_sim_ros.study.certification.campaign import make_campaign
    from helmet_sim_ros.study.certification.certify import run_campaign
    from helmet_sim_ros.study.certification.protocol import load_protocol
    from helmet_sim_ros.study.scenario.overrides import parse_overrides

    console = Console(highlight=False)
    campaign = make_campaign(
        helmet, protocol, load_protocol(protocol), parse_overrides(overrides), headforms
    )
    if scenario is not None:
        from helmet_sim_ros.report.certification.tables import to_scenario

        try:
            scenario.write_text(to_scenario(campaign), encoding="utf-8")
        except OSError as error:
            raise LogError(f"{scenario}: cannot be written: {error.strerror}") from error
        console.print(f"scenario: {scenario}", soft_wrap=True)
        return
    with shown_progress(console, "impacts") as progress:
        result = run_campaign(campaign, workers, progress)
    report(result, console)
    if output is not None:
        from helmet_sim_ros.report.certification.page import write_certification

        for path in write_certification(result, output):
            console.print(str(path), soft_wrap=True)
    if result.verdict == "fail":
        raise SystemExit(1)
