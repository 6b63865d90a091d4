# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Classes of what results, vehicles and recordings hold, for annotations; programs are given them and make none.

    from lugre_steering.typing import NamedEffect
"""

from lugre_steering.bag.find import Skipped
from lugre_steering.calibration.identify import Assumed, Combination
from lugre_steering.calibration.result import BagErrors, Covariance, FittedErrors, FittedKey, HeldOutErrors
from lugre_steering.diagnosis.found_law import FoundLaw, LawCurve, LawTie
from lugre_steering.diagnosis.result import (
    Augmented,
    BagTrace,
    Errors,
    Evidence,
    Experiment,
    FittedValue,
    FrictionForm,
    Limit,
    NamedEffect,
    Place,
    Unexplained,
)
from lugre_steering.effects.law_entry import LawEntry
from lugre_steering.estimator.estimator import Snapshot
from lugre_steering.online import Agreement, Peaks, PeaksOfBoth
from lugre_steering.provenance import Provenance, Source
from lugre_steering.recording import BagFinding, Channel, Finding, Kind, Signal
from lugre_steering.replay.result import InputCounts, ReplayedBag, Series
from lugre_steering.simulate.manoeuvres import Motion
from lugre_steering.simulate.plant import Truth
from lugre_steering.simulate.run import Simulated
from lugre_steering.vehicle.sections import (
    Axle,
    Contact,
    Coordinate,
    Cylinder,
    DmaTable,
    EffectEntry,
    Friction,
    Gravity,
    Hydraulics,
    Initial,
    Levers,
    MasterCurve,
    Rollers,
    Rubber,
    Sensors,
    Topics,
    TorqueSensor,
    Track,
    Wlf,
)

__all__ = [
    "Agreement",
    "Assumed",
    "Augmented",
    "Axle",
    "BagErrors",
    "BagFinding",
    "BagTrace",
    "Channel",
    "Combination",
    "Contact",
    "Coordinate",
    "Covariance",
    "Cylinder",
    "DmaTable",
    "EffectEntry",
    "Errors",
    "Evidence",
    "Experiment",
    "Finding",
    "FittedErrors",
    "FittedKey",
    "FittedValue",
    "FoundLaw",
    "Friction",
    "FrictionForm",
    "Gravity",
    "HeldOutErrors",
    "Hydraulics",
    "Initial",
    "InputCounts",
    "Kind",
    "LawCurve",
    "LawEntry",
    "LawTie",
    "Levers",
    "Limit",
    "MasterCurve",
    "Motion",
    "NamedEffect",
    "Peaks",
    "PeaksOfBoth",
    "Place",
    "Provenance",
    "ReplayedBag",
    "Rollers",
    "Rubber",
    "Sensors",
    "Series",
    "Signal",
    "Simulated",
    "Skipped",
    "Snapshot",
    "Source",
    "Topics",
    "TorqueSensor",
    "Track",
    "Truth",
    "Unexplained",
    "Wlf",
]  # fmt: skip
