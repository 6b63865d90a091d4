# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The ``prove`` command: a campaign of blind cases in, a scoreboard and pictures out."""

from __future__ import annotations

import platform
import secrets
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numba
import numpy
import scipy

from lugre_steering.counted import counted
from lugre_steering.effects import registry
from lugre_steering.errors import DataError, LugreSteeringError
from lugre_steering.files import output_folder, refuse_foreign, write_record
from lugre_steering.proof import campaign
from lugre_steering.proof.blind import source_version
from lugre_steering.proof.journal import run_all
from lugre_steering.proof.result import HowMade
from lugre_steering.proof.scoreboard import board
from lugre_steering.provenance import source
from lugre_steering.resources import config_folder
from lugre_steering.version import __version__

SIMULATORS = {"2": (2,), "3": (3,), "all": (2, 3)}
QUICK_BUDGET_S = 225.0
"""No case is begun after this, so that a quick run ends within five minutes."""


def run(
    out: Path,
    *,
    quick: bool = False,
    cases: str | None = None,
    simulator: str = "all",
    kinds: str | None = None,
    seed: int | None = None,
    each: int | None = None,
    peers: bool = False,
    announce: Callable[[str], None] = lambda _: None,
    progress: Callable[[str, int, int | None], None] = lambda *_: None,
) -> dict[str, Any]:
    """Run the campaign into DIR (finished cases of the same seed and code are kept), write scoreboard.json and figures."""
    if peers:
        from lugre_steering.proof.peers import missing

        for note in missing():
            announce(note)
    seed = secrets.randbelow(2**31) if seed is None else seed
    chosen = _chosen(seed, simulator, kinds, cases, quick)
    chosen = chosen if each is None else campaign.sampled(chosen, each)
    flags = {"--quick": quick, "--peers": peers, f"--simulator {simulator}": simulator != "all"}
    flags |= {f"--each {each}": each is not None, f"--kinds {kinds}": kinds is not None, f"--cases '{cases}'": cases is not None}
    command = " ".join(["lugre-steering prove --out DIR", f"--seed {seed}", *(flag for flag, given in flags.items() if given)])
    announce(f"{counted(len(chosen), 'case')}, seed {seed}; the same or an interrupted run again: {command.replace('DIR', str(out))}")
    sheet = config_folder() / "test_vehicle.yaml"
    with output_folder(out):
        refuse_foreign([out / "scoreboard.json"])
        rows = run_all(
            chosen, sheet, out / "cases.jsonl",
            peers=peers, budget_s=QUICK_BUDGET_S if quick else None, progress=progress,
        )  # fmt: skip
        shipped, code = replace(source(sheet), path=sheet.name), source_version()
        made = HowMade(
            synthetic=True, command=command, seed=seed, date=datetime.now(timezone.utc).strftime("%Y-%m-%d"),
            planned_cases=len(chosen), source=code, versions=_versions(), vehicle=shipped,
        )  # fmt: skip
        origin = registry.made("prove", {"command": command, "seed": seed, "source": code}, shipped)
        result = replace(board(rows, made), provenance=origin).json
        write_record(result, out / "scoreboard.json")
        try:
            from lugre_steering.proof.figures import draw_all
        except LugreSteeringError as error:  # raised where matplotlib is missing
            announce(str(error))
        else:
            draw_all(result, out)
    return result


def _chosen(seed: int, simulator: str, kinds: str | None, cases: str | None, quick: bool) -> list[campaign.Hiding]:
    """The cases that the options leave."""
    if simulator not in SIMULATORS:
        raise DataError(f"--simulator {simulator!r}: expected {', '.join(SIMULATORS)}")
    chosen = campaign.campaign(seed, SIMULATORS[simulator])
    if kinds is not None:
        chosen = campaign.of_kinds(chosen, kinds)
    if cases is not None:
        chosen = campaign.matching(chosen, cases)
    return campaign.quick(chosen) if quick else chosen


def _versions() -> dict[str, str]:
    return {
        "lugre_steering": __version__, "python": platform.python_version(),
        "numpy": numpy.__version__, "scipy": scipy.__version__, "numba": numba.__version__,
    }  # fmt: skip
