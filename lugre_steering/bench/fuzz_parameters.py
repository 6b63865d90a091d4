# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Parameter files of the node and saved defaults of the command line to be damaged."""

from __future__ import annotations

import io
import os
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import typer

from lugre_steering import cli, defaults
from lugre_steering.bench import fuzz_text
from lugre_steering.errors import LugreSteeringError
from lugre_steering.estimator.node_parameters import read_options

_FILE = "estimator_parameters.yaml"
_DEFAULTS = "defaults.yaml"
_SAVED = "vehicle: nowhere.yaml\nout: nowhere\ndiagnose.seed: 3\njobs: 2\nfail-on: [damaged_bag, missing_physics]\njson: true\n"


def corpus(folder: Path) -> None:
    """The shipped parameter file, and defaults of every type."""
    fuzz_text.copied([_FILE], folder)
    (folder / _DEFAULTS).write_text(_SAVED, encoding="utf-8")


def _command(place: Path) -> None:
    """A command that finds nothing to do, with the defaults there."""
    os.environ[defaults.VARIABLE] = str(place / _DEFAULTS)
    told = io.StringIO()
    try:
        with redirect_stderr(told), redirect_stdout(told):
            code = cli.app(["replay", str(place / "no.mcap")], standalone_mode=False)
    except (typer.BadParameter, typer.Abort) as error:
        raise LugreSteeringError(str(error)) from error
    if code:
        raise LugreSteeringError(told.getvalue())


def attempt(folder: Path, case: int) -> tuple[str, str]:
    """Read the options of a damaged file of parameters, or run a command with damaged defaults."""
    return fuzz_text.tried(folder, case, {_FILE: lambda place: read_options(place / _FILE), _DEFAULTS: _command})
