# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Static steering torque of rubber-tracked vehicles: estimate it, and find the physics that the model leaves out.

    import lugre_steering as ls
    vehicle = ls.load_vehicle("vehicle.yaml")
    ls.replay("bag", vehicle).plot()
    ls.calibrate(["a", "b"], vehicle).calibrated
    ls.diagnose(["a", "b"], vehicle).effects
    ls.simulate("double-cycle", vehicle).recording
    ls.Recording.from_arrays(time, angle={"left": left, "right": right}, pressure={"main_a": pressure})

What ``__all__`` names is public, with the public attributes of what it names, and follows semantic versioning; so are the classes of these
attributes (``lugre_steering.typing``) and what own physics is written with (``lugre_steering.effects``). Everything is loaded when it is
first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from lugre_steering.version import __version__ as __version__

if TYPE_CHECKING:
    from lugre_steering.calibration.library import calibrate
    from lugre_steering.calibration.result import Calibration
    from lugre_steering.diagnosis.library import diagnose, write_report
    from lugre_steering.diagnosis.result import Diagnosis
    from lugre_steering.effects.registry import add_files as add_effects
    from lugre_steering.errors import (
        BagError,
        DataError,
        EffectError,
        ImplausibleWarning,
        LugreSteeringError,
        MapFileError,
        VehicleFileError,
    )
    from lugre_steering.estimator import Estimator, Options
    from lugre_steering.recording import Recording
    from lugre_steering.replay.library import replay
    from lugre_steering.replay.result import Replay
    from lugre_steering.simulate.library import simulate
    from lugre_steering.simulate.result import Simulation
    from lugre_steering.vehicle import Vehicle
    from lugre_steering.vehicle import load as load_vehicle
    from lugre_steering.vehicle import save as save_vehicle
    from lugre_steering.vehicle.keep import keep_law

__all__ = [
    "BagError", "Calibration", "DataError", "Diagnosis", "EffectError", "Estimator", "ImplausibleWarning", "LugreSteeringError",
    "MapFileError", "Options", "Recording", "Replay", "Simulation", "Vehicle", "VehicleFileError", "add_effects", "calibrate", "diagnose",
    "keep_law", "load_vehicle", "replay", "save_vehicle", "simulate", "write_report",
]  # fmt: skip

_PLACES = {
    "BagError": "errors", "Calibration": "calibration.result", "DataError": "errors", "Diagnosis": "diagnosis.result",
    "EffectError": "errors", "Estimator": "estimator", "ImplausibleWarning": "errors", "LugreSteeringError": "errors",
    "MapFileError": "errors", "Options": "estimator", "Recording": "recording", "Replay": "replay.result", "Simulation": "simulate.result",
    "Vehicle": "vehicle", "VehicleFileError": "errors", "calibrate": "calibration.library", "diagnose": "diagnosis.library",
    "keep_law": "vehicle.keep", "write_report": "diagnosis.library",
}  # fmt: skip
_RENAMED = {
    "load_vehicle": ("vehicle", "load"), "save_vehicle": ("vehicle", "save"), "add_effects": ("effects.registry", "add_files"),
}  # fmt: skip
_ROOMS = ("replay", "simulate")
"""Called themselves; see ``callable_room``."""


def __getattr__(name: str) -> Any:
    if name in _ROOMS:
        return importlib.import_module(f"{__name__}.{name}")
    place, there = _RENAMED.get(name, (_PLACES.get(name), name))
    if place is None:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    value = getattr(importlib.import_module(f"{__name__}.{place}"), there)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
