"""The command line ``helmet-sim``: one verb per file of this package.

A verb is a module ``cli/NAME.py`` with a click command called ``command``. The first line of the
module's docstring is its line in ``helmet-sim --help``. Only the verb that is used gets imported,
so help and completion stay fast. Files that start with ``_`` are no verbs.
"""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

import click

from helmet_sim_ros.errors import HelmetSimError, LogError, PulseError, SetupError
from helmet_sim_ros.lasting import lasting

#: Errors of what the user gave, as opposed to what went wrong with it: exit code 2.
BAD_INPUT = (SetupError, PulseError, LogError)


class BadInput(click.ClickException):
    """What the user gave is refused; nothing was run."""

    exit_code = 2


class Verbs(click.Group):
    """The verbs found beside this file, loaded when used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        files = Path(__file__).parent.glob("*.py")
        return sorted(path.stem for path in files if not path.stem.startswith("_"))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in self.list_commands(ctx):
            return None
        with lasting():
            module = import_module(f"{__name__}.{cmd_name}")
        command: click.Command = module.command
        command.name = cmd_name
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        rows = [(name, first_line(name)) for name in self.list_commands(ctx)]
        with formatter.section("Commands"):
            formatter.write_dl(rows)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except HelmetSimError as error:
            kind = BadInput if isinstance(error, BAD_INPUT) else click.ClickException
            raise kind(str(error)) from error
        except ModuleNotFoundError as error:
            if (error.name or __name__).startswith(__package__.partition(".")[0]):
                raise  # a mistake of ours
            raise click.ClickException(
                f"this verb needs {error.name}, which is not installed; the extras bring it: "
                "pip install 'helmet_sim_ros[ros,report,study]', or in the source tree '.[...]'"
            ) from error


def first_line(verb: str) -> str:
    """First docstring line of a verb's module, read without importing it."""
    source = (Path(__file__).parent / f"{verb}.py").read_text(encoding="utf-8")
    return (ast.get_docstring(ast.parse(source)) or "").partition("\n")[0].rstrip(".")


@click.group(cls=Verbs, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="helmet_sim_ros")
def main() -> None:
    """Simulate helmeted riders hitting the ground, and judge the impact on the head."""
