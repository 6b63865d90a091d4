# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Command line: a thin shell. Each command parses arguments, calls one function of the package and prints what it returns."""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from rich.console import Console

from lugre_steering.errors import LugreSteeringError

app = typer.Typer(
    help="Steering torque of rubber-tracked vehicles: estimate it, and find the physics that the model leaves out.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Bags = Annotated[list[Path], typer.Argument(help="rosbag2 folders or files (mcap or sqlite3, compressed or not)")]
VehicleFile = Annotated[Path, typer.Option("--vehicle", help="vehicle file (YAML)")]
OutFolder = Annotated[Path, typer.Option("--out", help="folder for the results")]
Json = Annotated[bool, typer.Option("--json", help="print the result as JSON on stdout")]

F = TypeVar("F", bound=Callable[..., Any])


def console() -> Console:
    """Where progress and messages go: stderr, so that stdout carries results only."""
    return Console(stderr=True)


def print_json(result: Any) -> None:
    """The result of a command on stdout, for scripts."""
    print(json.dumps(result, indent=2, allow_nan=False))


def command(function: F) -> F:
    """Register a command whose expected errors end as one line on stderr and exit code 2."""

    @app.command()
    @functools.wraps(function)
    def run(*arguments: Any, **options: Any) -> Any:
        try:
            return function(*arguments, **options)
        except LugreSteeringError as error:
            print(f"lugre-steering: {error}", file=sys.stderr)
            raise typer.Exit(2) from None

    return function


def main() -> None:
    """Entry point of ``lugre-steering``."""
    app()


if __name__ == "__main__":
    main()
