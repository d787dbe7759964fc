"""The command ``unilavira``: its subcommands, and what its exit codes mean.

=====  ==========================================================================
code   meaning
=====  ==========================================================================
0      the episode ended, also without success
2      bad input: the message names place, value and remedy
3      the machine or a service is not able (no renderer, model unreachable); for
       ``ask`` also a reply that was refused or cut off
130    interrupted; what was done is kept
=====  ==========================================================================
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from unilavira_drake.cli.ask import ask
from unilavira_drake.cli.doctor import doctor
from unilavira_drake.cli.listing import ports, scenarios
from unilavira_drake.cli.report import report
from unilavira_drake.cli.run import run
from unilavira_drake.cli.serve import serve
from unilavira_drake.errors import InfrastructureError, InputError
from unilavira_drake.recording.result import installed_versions

BAD_INPUT, INFRASTRUCTURE = 2, 3

app = typer.Typer(
    name="unilavira",
    help="Robots that follow a person's words, simulated with Drake.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _tell_versions(wanted: bool) -> None:
    if wanted:
        versions = installed_versions()
        print(f"unilavira-drake {versions['unilavira-drake']}, drake {versions['drake']}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            help="Prints the versions of this package and of Drake.",
            callback=_tell_versions,  # Called before a missing command is an error.
            is_eager=True,
        ),
    ] = False,
) -> None:
    pass


for command in (run, report, ask, serve, ports, scenarios, doctor):
    app.command()(command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code."""
    try:
        app(args=None if arguments is None else list(arguments), prog_name="unilavira")
    except SystemExit as done:
        if isinstance(done.code, str):  # Drake's assertions arrive like this.
            return _failed(done, BAD_INPUT)
        return done.code or 0
    except InputError as error:
        return _failed(error, BAD_INPUT)
    except InfrastructureError as error:
        return _failed(error, INFRASTRUCTURE)
    return 0


def _failed(error: BaseException, code: int) -> int:
    print(f"unilavira: {error}", file=sys.stderr)
    return code
