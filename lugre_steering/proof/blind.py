# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""One case, blind: recordings are made in a temporary folder, and another process diagnoses bags and vehicle sheet alone."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence, Set
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.errors import LugreSteeringError
from lugre_steering.proof import hydraulics
from lugre_steering.proof.campaign import PEERS_EVERY, Hiding
from lugre_steering.proof.sensors import PERIOD_S
from lugre_steering.proof.simulator import (
    BagData,
    Case,
    CaseData,
    Concealed,
    load_sheet,
    noise_variance,
    recalibrated_variance,
    removable_variance,
    simulate_case,
    variances_beside,
    write_case,
)
from lugre_steering.proof.vehicle_draw import Sheet

PACKAGE = Path(__file__).resolve().parents[1]
LONGEST_S = 900.0
STRONGEST = 4.0
"""Times its typical size that an effect may be enlarged to reach the wanted ratio; beyond, it would not be the same physics.

What recalibration masks nearly wholly then stays below the wanted ratio and is counted where it arrives."""
ONE_THREAD = dict.fromkeys(("LUGRE_STEERING_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
KEPT = ("verdict", "noise_floor_Nm", "baseline", "augmented", "unexplained")
KEPT_OF_EFFECT = ("id", "p_value", "parameters", "where", "energy_share", "masked_share", "indistinguishable_from")

Row = dict[str, Any]


@dataclass(frozen=True)
class Job:
    """What a worker process needs to run one case."""

    hiding: Hiding
    sheet_file: Path
    version: str
    peers: bool


def source_version() -> str:
    """Hash of the code that decides the outcome of a case: what a diagnosis and its recordings need, not reports, scores and shells."""
    aside = {PACKAGE / folder for folder in ("report", "live", "bench", "calibration", "importing", "estimator")}
    beside = {PACKAGE / f"{name}.py" for name in ("cli", "online", "replay")}
    scoring = {PACKAGE / "proof" / f"{name}.py" for name in ("scoreboard", "table", "command", "peers")}
    digest = hashlib.sha256()
    for file in sorted(PACKAGE.rglob("*.py")):
        if file not in beside | scoring and not aside.intersection(file.parents):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def noise_of(data: CaseData) -> float:
    """Noise variance of both bags together [N2 m2]."""
    return float(np.average([noise_variance(data, bag) for bag in data.bags], weights=[bag.time.size for bag in data.bags]))


def removable_of(data: CaseData) -> float:
    return float(np.average([removable_variance(bag) for bag in data.bags], weights=[bag.time.size for bag in data.bags]))


def ratios_beside(data: CaseData) -> dict[str, float]:
    """Of each of several effects: the variance that neither recalibration nor the others can imitate, over that of the noise."""
    return {id_: value / noise_of(data) for id_, value in variances_beside(data).items()} if len(data.hidden) > 1 else {}


def seen_noise_variance(data: CaseData, bag: BagData) -> float:
    """Noise variance [N2 m2] on a common clock that reads between the samples of every channel, all phases alike.

    Lower than ``noise_variance`` for white noise, since interpolation averages: what is left to a perfect model there.
    """
    start = max(samples.time[0] for samples in (*bag.angles, *bag.pressures))
    time = np.arange(start, min(samples.time[-1] for samples in bag.pressures), 0.1 * PERIOD_S)
    angles = np.stack([np.interp(time, bag.time, angle) for angle in bag.clean_angles])
    seen = np.stack([np.interp(time, samples.time, samples.value) for samples in bag.pressures])
    measured = hydraulics.torque_of(seen, hydraulics.line_gain(data.sheet, angles))
    return float(np.mean((measured - np.interp(time, bag.time, bag.torque)) ** 2))


def make(hiding: Hiding, sheet: Sheet) -> CaseData:
    """Simulate a case with each effect at the strength that gives it the wanted effect-to-noise ratio after recalibration."""
    effects = tuple(_sized(concealed, hiding, sheet) for concealed in _concealed(hiding))
    return simulate_case(Case(hiding.seed, effects, hiding.noise), sheet)


def _concealed(hiding: Hiding) -> list[Concealed]:
    rng = np.random.default_rng((hiding.seed, 99))
    bag, start = int(rng.integers(2)), float(rng.uniform(35.0, 55.0))
    return [
        Concealed(
            effect,
            only_bag=bag if hiding.disguise == "one-bag" else None,
            from_time_s=start if hiding.disguise == "late" else None,
            barely=hiding.disguise == "barely",
        )
        for effect in hiding.effects
    ]


def _sized(concealed: Concealed, hiding: Hiding, sheet: Sheet) -> Concealed:
    """Secant steps in the logarithms, from "amplitude goes with the root of the variance": nature is not linear in strength."""
    strength, power, tried = 1.0, 2.0, []
    for _ in range(6):
        sized = Concealed(concealed.id, strength, concealed.only_bag, concealed.from_time_s, concealed.barely)
        data = simulate_case(Case(hiding.seed, (sized,), hiding.noise), sheet)
        off = float(np.log(max(recalibrated_variance(data) / noise_of(data), 1e-12) / hiding.ratio))
        if abs(off) < np.log(1.25) or (off < 0.0 and strength == STRONGEST):
            break
        tried.append((np.log(strength), off))
        if len(tried) > 1 and tried[-1][0] != tried[-2][0]:
            power = float(np.clip((tried[-1][1] - tried[-2][1]) / (tried[-1][0] - tried[-2][0]), 1.0, 6.0))
        strength = min(strength * float(np.exp(-off / power)), STRONGEST)
    return sized


def run(job: Job) -> Row:
    """Make, diagnose and describe one case. A diagnosis that fails is an outcome too: ``error`` says how."""
    hiding, started = job.hiding, time.perf_counter()
    sheet = load_sheet(job.sheet_file)
    data = make(hiding, sheet)
    with tempfile.TemporaryDirectory(prefix="lugre_proof_") as temporary:
        seen, unseen = Path(temporary) / "seen", Path(temporary) / "unseen"
        bags = write_case(data, seen, unseen)
        made = time.perf_counter()
        diagnosis, error = diagnose(bags, seen / "vehicle.yaml", Path(temporary) / "out")
        row: Row = {
            "name": hiding.name, "kind": hiding.kind, "noise": hiding.noise, "seed": hiding.seed, "version": job.version,
            "wanted_ratio": hiding.ratio, "ratio": recalibrated_variance(data) / noise_of(data) if hiding.effects else 0.0,
            "masked": 1.0 - recalibrated_variance(data) / removable_of(data) if hiding.effects else 0.0,
            "ratio_beside": ratios_beside(data),
            "strengths": [effect.strength for effect in data.case.effects],
            "truth": truth(data, [bag.name for bag in bags]), "diagnosis": diagnosis, "error": error,
            "seconds": {"making": made - started, "diagnosis": time.perf_counter() - made},
        }  # fmt: skip
        if job.peers:
            from lugre_steering.proof.peers import compare

            row["peers"] = compare(bags, seen / "vehicle.yaml")
    return row


def diagnose(bags: Sequence[Path], vehicle: Path, out: Path) -> tuple[Row | None, str | None]:
    """The command line, as a user runs it, on one thread; what scoring needs of its result, or what went wrong."""
    environment = {**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join([str(PACKAGE.parent), os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, "-m", "lugre_steering.cli", "diagnose", *map(str, bags), "--vehicle", str(vehicle)]
    try:
        done = subprocess.run(
            [*command, "--out", str(out), "--no-report"], env=environment, capture_output=True, text=True, timeout=LONGEST_S, check=False
        )
    except subprocess.TimeoutExpired:
        return None, f"no answer within {LONGEST_S:g} s"
    if done.returncode != 0:
        return None, (done.stderr.strip().splitlines() or ["no message"])[-1]
    result = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    kept = {key: result[key] for key in KEPT}
    kept["effects"] = [{key: effect[key] for key in KEPT_OF_EFFECT} for effect in result["effects"]]
    return kept, None


def truth(data: CaseData, names: Sequence[str]) -> Row:
    """What scoring needs of the truth: drawn values (SI; a line by its name), where each effect acts, variances [N2 m2]."""
    return {
        "effects": [
            {
                "id": effect.id, "only_bag": effect.only_bag,
                "parameters": {k: data.sheet.lines[int(v)] if k == "line" else v for k, v in effect.values.items()},
            }
            for effect in data.hidden
        ],
        "bags": {
            name: {
                "manoeuvre": bag.manoeuvre, "duration_s": float(bag.time[-1]), "intervals_s": bag.intervals,
                "removable_variance": removable_variance(bag), "noise_variance": noise_variance(data, bag),
                "seen_noise_variance": seen_noise_variance(data, bag),
            }
            for name, bag in zip(names, data.bags, strict=True)
        },
    }  # fmt: skip


def finished(journal: Path, version: str, compared: Set[str]) -> dict[str, Row]:
    """Cases that a run of the same code has finished, by name and seed; a line cut off by an interruption is left out.

    ``compared``: names of the cases that need the answers of the peers too.
    """
    rows: dict[str, Row] = {}
    if not journal.exists():
        return rows
    for line in journal.read_text(encoding="utf-8").splitlines():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        if row["version"] == version and row["error"] is None and ("peers" in row or row["name"] not in compared):
            rows[f"{row['name']} {row['seed']}"] = row
    return rows


def run_all(
    cases: Sequence[Hiding],
    sheet_file: Path,
    journal: Path,
    *,
    peers: bool = False,
    budget_s: float | None = None,
    progress: Callable[[str, int, int | None], None] = lambda *_: None,
) -> list[Row]:
    """Run what the journal does not have yet, one process per core; no case is begun once ``budget_s`` has passed.

    An interruption (Ctrl-C) ends it with the cases finished so far.
    """
    version, begun = source_version(), time.monotonic()
    # By the seed of the case, so that a part of a campaign compares the same cases as the whole.
    compared = {case.name for case in cases if peers and case.seed % PEERS_EVERY == 0}
    known: Mapping[str, Row] = finished(journal, version, compared)
    rows = [known[f"{case.name} {case.seed}"] for case in cases if f"{case.name} {case.seed}" in known]
    waiting = [case for case in cases if f"{case.name} {case.seed}" not in known]
    workers = os.cpu_count() or 1
    progress("cases", len(rows), len(cases))
    # A fresh interpreter per worker: forking a process that has compiled code and threads is not safe.
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool, journal.open("a", encoding="utf-8") as log:
        if journal.stat().st_size and not journal.read_bytes().endswith(b"\n"):
            log.write("\n")  # a line cut off by an interruption must not swallow the next one
        running: set[Future[Row]] = set()
        while waiting or running:
            if budget_s is not None and time.monotonic() - begun > budget_s:
                waiting = []
            while waiting and len(running) < workers:
                case = waiting.pop(0)
                running.add(pool.submit(run, Job(case, sheet_file, version, case.name in compared)))
            if not running:
                break
            try:
                done, running = wait(running, return_when=FIRST_COMPLETED)
            except KeyboardInterrupt:  # score what is there; the same command goes on later
                pool.shutdown(wait=False, cancel_futures=True)
                break
            for future in done:
                try:
                    rows.append(future.result())
                except BrokenProcessPool as error:
                    raise LugreSteeringError("prove: a worker died, perhaps for want of memory; finished cases are kept") from error
                log.write(json.dumps(rows[-1]) + "\n")
                log.flush()
            progress("cases", len(rows), len(cases))
    return rows
