"""Draw the figures of the coupling paper from logs, as SVG or PDF."""

from __future__ import annotations

import os
from pathlib import Path

import click

from helmet_sim_ros.cli._console import PlainConsole
from helmet_sim_ros.cli._logs import BAD_INPUT, complain, logs_argument, open_logs
from helmet_sim_ros.errors import LogError


@click.command()
@logs_argument
@click.option("--output", "-o", type=click.Path(path_type=Path), default=Path("figures"),
              show_default=True, metavar="DIR", help="Where the figures go.")  # fmt: skip
@click.option("--format", "-f", "forms", type=click.Choice(["svg", "pdf", "png"]), multiple=True,
              default=("svg",), show_default=True, help="Repeatable.")  # fmt: skip
def command(logs: tuple[Path, ...], output: Path, forms: tuple[str, ...]) -> None:
    """Figures in the layout of the paper's Figs 3-5 (drop tests) and 7-9 (oblique impacts).

    Several LOGs go into the same figures, so that helmets can be compared.
    """
    from helmet_sim_ros.report.figures.paper import paper_figures
    from helmet_sim_ros.report.figures.save import save_figure

    opened, code = open_logs(logs)
    figures = paper_figures(impact for log in opened for impact in log)
    if not figures:
        names = ", ".join(map(str, logs))
        raise SystemExit(
            max(code, complain(LogError(f"{names}: no drop test and no impact of a rider to draw")))
        )
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        complain(LogError(f"{output}: cannot be written: {error.strerror}"))
        raise SystemExit(BAD_INPUT) from error
    for name, figure in figures.items():
        for form in forms:
            path = output / f"{name}.{form}"
            save_figure(figure, path)
            PlainConsole().print(os.path.relpath(path), markup=False, soft_wrap=True)
    raise SystemExit(code)
