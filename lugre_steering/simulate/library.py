# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""``lugre_steering.simulate``: synthetic recordings from a program."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lugre_steering.errors import DataError
from lugre_steering.given_several import texts
from lugre_steering.simulate.command import load_vehicle, simulation
from lugre_steering.simulate.plant import with_effects
from lugre_steering.simulate.result import Simulation
from lugre_steering.vehicle import Vehicle, vehicle_of


def simulate(
    what: str | Path, vehicle: Vehicle | str | Path | None = None, *, effects: str | Sequence[str] = (), **sensing: float
) -> Simulation:
    """Drive a manoeuvre and record it: no file is written before ``save``.

    ``what``: a built-in manoeuvre ('double-cycle'; ``lugre-steering simulate --list`` shows all), a YAML or CSV file, or a bag whose
    angles are driven; ``vehicle``: a vehicle or the path of its file, the shipped test vehicle if left out; ``effects``: physics to
    add, each 'id:parameter=value,...' (SI), one or several; ``sensing``: ``angle_rate_Hz``, ``pressure_rate_Hz``, ``jitter_s``,
    ``angle_noise_deg``, ``angle_resolution_deg``, ``pressure_noise_Pa``, ``pressure_resolution_Pa``, ``seed``.
    """
    model = load_vehicle(None) if vehicle is None else vehicle_of(vehicle)
    if not isinstance(what, (str, Path)):
        raise DataError(f"what: got {type(what).__name__}, expected the name of a manoeuvre or the path of a file")
    added = texts("effects", effects, "texts 'id:parameter=value,...'")
    return simulation(str(what), with_effects(model, added), sensing)
