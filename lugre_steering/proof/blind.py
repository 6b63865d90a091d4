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
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lugre_steering.proof.campaign import WITHOUT, Hiding
from lugre_steering.proof.made import Made, Wanted, beside, pooled_noise, pooled_removable, recalibrated, removable_of
from lugre_steering.proof.measurable import measured
from lugre_steering.proof.simulator import CaseData
from lugre_steering.proof.sizing import make
from lugre_steering.proof.worlds import LAW, SecondCase, maker, mistake_of

PACKAGE = Path(__file__).resolve().parents[1]
LONGEST_S = 900.0
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
    shown = ("scoreboard", "scores", "targets", "table", "command", "peers", "figures", "journal")
    scoring = {PACKAGE / "proof" / f"{name}.py" for name in shown}
    digest = hashlib.sha256()
    for file in sorted(PACKAGE.rglob("*.py")):
        if file not in beside | scoring and not aside.intersection(file.parents):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def noise_of(data: CaseData) -> float:
    """Noise variance of both bags of a case of the second simulator together [N2 m2]."""
    return pooled_noise(SecondCase(data))


def run(job: Job) -> Row:
    """Make, diagnose and describe one case. A diagnosis that fails is an outcome too: ``error`` says how."""
    hiding, started = job.hiding, time.perf_counter()
    made, wanted = make(hiding, job.sheet_file)
    with tempfile.TemporaryDirectory(prefix="lugre_proof_") as temporary:
        seen, unseen, out = (Path(temporary) / name for name in ("seen", "unseen", "out"))
        bags = made.write(seen, unseen)
        ready = time.perf_counter()
        diagnosis, error = diagnose(bags, seen / "vehicle.yaml", out)
        row = {
            **described(job, made, wanted), "truth": truth(made, [bag.name for bag in bags]), "diagnosis": diagnosis, "error": error,
            "seconds": {"making": ready - started, "diagnosis": time.perf_counter() - ready},
        }  # fmt: skip
        if hiding.kind == WITHOUT and error is None:
            row["without"], row["error"] = diagnose(bags, seen / "vehicle.yaml", out / "without", "--without", *hiding.effects)
        if diagnosis is not None:
            row["measured"] = measured(made, out / "augmented.yaml", diagnosis)
        if diagnosis is not None and LAW in hiding.effects:
            row["unseen"] = foretold(job, bags, seen / "vehicle.yaml", out / "augmented.yaml", unseen / "run_unseen", Path(temporary))
        if job.peers:
            from lugre_steering.proof.peers import compare

            row["peers"] = compare(bags, seen / "vehicle.yaml")
    return row


def described(job: Job, made: Made, wanted: Sequence[Wanted]) -> Row:
    """Which case this is, and how large what it hides turned out."""
    hiding = job.hiding
    left = recalibrated(made) if hiding.effects else 0.0
    return {
        "name": hiding.name, "kind": hiding.kind, "noise": hiding.noise, "seed": hiding.seed, "version": job.version,
        "simulator": hiding.simulator, "wanted_ratio": hiding.ratio, "ratio": left / pooled_noise(made) if hiding.effects else 0.0,
        "masked": 1.0 - left / max(pooled_removable(made), 1e-300) if hiding.effects else 0.0, "removable_variance": left,
        "ratio_beside": {id_: value / pooled_noise(made) for id_, value in beside(made).items()},
        "strengths": [effect.strength for effect in wanted], "mistake": mistake_of(made),
    }  # fmt: skip


def called(*words: str) -> tuple[str | None, float]:
    """Run a command of this package as a user does, on one thread: what went wrong if anything did, and the seconds it took."""
    environment = {**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join([str(PACKAGE.parent), os.environ.get("PYTHONPATH", "")])}
    begun = time.perf_counter()
    try:
        done = subprocess.run(
            [sys.executable, "-m", "lugre_steering.cli", *words], env=environment, capture_output=True, text=True, timeout=LONGEST_S,
            check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"no answer within {LONGEST_S:g} s", LONGEST_S
    if done.returncode != 0:
        return (done.stderr.strip().splitlines() or ["no message"])[-1], time.perf_counter() - begun
    return None, time.perf_counter() - begun


def diagnose(bags: Sequence[Path], vehicle: Path, out: Path, *more: str) -> tuple[Row | None, str | None]:
    """What scoring needs of a diagnosis, or what went wrong."""
    error, _ = called("diagnose", *map(str, bags), "--vehicle", str(vehicle), "--out", str(out), "--no-report", *more)
    if error is not None:
        return None, error
    result = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    kept = {key: result[key] for key in KEPT}
    kept["effects"] = [{key: effect[key] for key in KEPT_OF_EFFECT} for effect in result["effects"]]
    for effect, full in zip(kept["effects"], result["effects"], strict=True):
        effect["bends"] = bool(full.get("bends"))
    kept["laws"] = result.get("laws", [])
    kept["findings"] = [{key: finding.get(key) for key in ("finding", "suspects")} for finding in result["data_quality"]]
    return kept, None


def foretold(job: Job, bags: Sequence[Path], sheet: Path, augmented: Path, unseen: Path, folder: Path) -> Row:
    """Root mean square errors [N m] of replays on a manoeuvre that nobody recorded: of the recalibrated baseline, of the diagnosed
    file, and of the recalibrated baseline where the same case hides nothing, which is what is left to a perfect law."""
    twin = maker(job.hiding, job.sheet_file)([Wanted(LAW, strength=0.0)])
    plain = twin.write(folder / "plain", folder / "plain_unseen")
    error = None
    for name, recordings in (("calibrated", bags), ("plain_calibrated", plain)):
        error = error or called("calibrate", *map(str, recordings), "--vehicle", str(sheet), "--out", str(folder / name))[0]
    replays = {
        "baseline_Nm": (unseen, folder / "calibrated" / "calibrated.yaml"), "augmented_Nm": (unseen, augmented),
        "floor_Nm": (folder / "plain_unseen" / "run_unseen", folder / "plain_calibrated" / "calibrated.yaml"),
    }  # fmt: skip
    found: Row = {}
    for name, (bag, file) in replays.items():
        error = error or called("replay", str(bag), "--vehicle", str(file), "--out", str(folder / name))[0]
        if error is not None:
            return {"error": error}
        summary = json.loads((folder / name / "summary.json").read_text(encoding="utf-8"))
        found[name] = (summary["overall"] or {}).get("rmse_Nm")
    return found


def truth(made: Made, names: Sequence[str]) -> Row:
    """What scoring needs of the truth: drawn values (SI; a line by its name), where each effect acts, variances [N2 m2]."""
    return {
        "effects": [
            {"id": effect.id, "only_bag": effect.only_bag, "parameters": made.told(effect)} for effect in made.hidden
        ],
        "bags": {
            name: {
                "manoeuvre": bag.manoeuvre, "duration_s": float(bag.time[-1]), "intervals_s": bag.intervals,
                "removable_variance": removable_of(bag), "noise_variance": made.noise_variance(i),
                "seen_noise_variance": made.seen_noise_variance(i),
            }
            for i, (name, bag) in enumerate(zip(names, made.bags, strict=True))
        },
    }  # fmt: skip
