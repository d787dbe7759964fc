"""``unilavira report``: the page that shows why the agent did what it did."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Annotated

import typer

from unilavira_drake.errors import InputError
from unilavira_drake.report.page import render_report

REPORT = "report.html"


def report(
    folder: Annotated[Path, typer.Argument(help="A run folder.", metavar="DIR")],
    out: Annotated[
        Path | None,
        typer.Option(help="The file to write; default: report.html in DIR.", metavar="FILE"),
    ] = None,
) -> None:
    """Writes one page about a run: what it saw, thought, chose and came to, step by step."""
    path = folder / REPORT if out is None else out
    # A reply may hold half of a surrogate pair, which no file can.
    page = render_report(folder).encode("utf-8", "replace")
    beside = path.with_name(f".{path.name}.partial")
    try:
        beside.write_bytes(page)
        os.replace(beside, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            beside.unlink()
        raise InputError(
            f"--out: {str(path)!r} cannot be written ({error.strerror or error}); name a file in "
            "a folder that exists and can be written."
        ) from None
    print(f"report: {path} ({len(page) / 1e6:.1f} MB); open it in a browser")
