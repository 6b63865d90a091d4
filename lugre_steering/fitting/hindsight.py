# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The error of a model where the motion is known from all samples, later ones too: of its physics, without that of a live motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lugre_steering.data.dataset import prepare
from lugre_steering.data.quality import inspect
from lugre_steering.data.stamps import with_even_stamps
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Recording
from lugre_steering.vehicle import Vehicle


def hindsight_rmse(vehicle: Vehicle, recording: Recording, rubber_degC: float | None = None) -> float:
    """Root mean square error [N m] of a vehicle file on a recording whose motion is smoothed over all of it, as a diagnosis has it, on
    the samples that may be used. Bristles are at the start as it tells, the rubber, if there is any, as warm as the file says or as
    given [degC].

    Raises ``DataError`` where a channel is missing or too short.
    """
    if rubber_degC is not None:
        assert vehicle.initial is not None
        vehicle = vehicle.replace(initial=replace(vehicle.initial, rubber_temperature_degC=rubber_degC))
    run = prepare(with_even_stamps(inspect(recording, vehicle).recording), vehicle)
    problem = Problem(vehicle, [run], ()).with_known_weather()
    error = (run.measured - fit(problem, problem.sensor_weight).prediction)[run.valid]
    return float(np.sqrt(np.mean(np.square(error))))
