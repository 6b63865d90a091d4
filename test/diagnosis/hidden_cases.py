# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Blind bags with hidden effects, made by a simulator that shares no model code with the diagnosis; and shorter or slower ones of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from bag_making import STRIDE, slowly_sampled

from lugre_steering.bag import read_recording
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.proof.simulator import Case, CaseData, Concealed, load_sheet, simulate_case, write_case
from lugre_steering.recording import Recording, Signal
from lugre_steering.vehicle import load

VEHICLE = Path(__file__).resolve().parents[2] / "config" / "test_vehicle.yaml"


def made(
    folder: Path, *effects: Concealed, seed: int = 7, noise: str = "white", seconds: float = np.inf, stride: int = STRIDE
) -> tuple[CaseData, list[Path]]:
    """Two slow blind bags with hidden effects, or their first seconds."""
    data = simulate_case(Case(seed, effects, noise, ("sweeps", "decaying")), load_sheet(VEHICLE))  # type: ignore[arg-type]
    return data, write_case(slowly_sampled(data, seconds, stride), folder / "case", folder / "truth")


def read(bags: list[Path]) -> list[Recording]:
    return [read_recording(bag, load(VEHICLE).channels) for bag in bags]


def cut(recording: Recording, until_s: float, since_s: float = 0.0) -> Recording:
    """Some seconds of a recording only."""

    def short(signal: Signal) -> Signal:
        keep = (signal.time_s < until_s) & (signal.time_s >= since_s)
        return Signal(signal.time_s[keep], signal.value[keep])

    return Recording(
        recording.name, recording.start_ns, {k: short(s) for k, s in recording.angle.items()},
        {k: short(s) for k, s in recording.pressure.items()},
    )  # fmt: skip


def names(result: Diagnosis) -> set[str]:
    """Every name given, ties included."""
    return {name for e in result.json["effects"] for name in (e["id"], *e["indistinguishable_from"])}


def overlap(found: list[list[float]], true: list[tuple[float, float]]) -> float:
    """Intersection over union of two sets of stretches, on a 10 ms grid."""
    grid = np.arange(0.0, 400.0, 0.01)
    a, b = (np.any([(grid >= s) & (grid <= e) for s, e in spans], axis=0) for spans in (found, true))
    return float(np.sum(a & b) / np.sum(a | b))
