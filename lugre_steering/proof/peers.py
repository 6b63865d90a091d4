# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Other methods on the same recordings: they learn the residual of the recalibrated model and are judged on held-out blocks.

Settings, the same for every recording:

- All get the engine's own recalibration as a start, its smoothed motion, its fit and held-out blocks (8 s, gaps of 1 s), samples
  weighted alike, and as inputs angle, rate, acceleration, angle since reversal, accumulated slip, dwell, direction, time, model
  torque and its rate. Inputs and target are standardised on the fit blocks.
- Recalibration: the same fit without priors, with pressure gain and kingpin arm free too.
- SINDy ensemble (Fasel et al., Proc. R. Soc. A 478 (2022) 20210904): sequentially thresholded least squares over LIBRARY, bagging
  of 20, threshold by 3-fold block cross-validation, terms kept that 80 % of the models have. It names the effects that its largest
  term stands for, if its alarm is on.
- Gaussian process: sum of a constant, an anisotropic RBF and a white kernel, marginal likelihood, 500 evenly spread samples.
- Gradient-boosted trees: 300 steps of rate 0.05, at least 50 samples a leaf, stopped early on a tenth of the fit samples.
- Symbolic regression: 400 programs, 12 generations, parsimony 1e-3, 1500 evenly spread samples. It gives a formula, no names.

A method raises an alarm when it lowers the held-out mean square by more than ALARM_GAIN and the 95 % interval of that gain
(bootstrap over stretches of 2 s) lies above zero.
"""

from __future__ import annotations

import importlib.util
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lugre_steering.bag import read_recording
from lugre_steering.data.dataset import prepare
from lugre_steering.diagnosis.search.locate import coordinates
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.problem import GAIN, KINGPIN, Problem, calibrations_for
from lugre_steering.fitting.split import Split, split
from lugre_steering.vehicle import load

Array = NDArray[np.float64]

ALARM_GAIN = 0.01
INPUTS = (
    "steering angle", "steering rate", "steering acceleration", "angle since reversal", "accumulated slip", "dwell", "direction",
    "time", "torque", "torque rate",
)  # fmt: skip

LIBRARY: dict[str, tuple[Callable[[Mapping[str, Array]], Array], tuple[str, ...]]] = {
    "1": (lambda c: np.ones_like(c["time"]), ("slope_bias", "pressure_offset")),
    "t": (lambda c: c["time"], ("pressure_drift",)),
    "theta": (lambda c: c["steering angle"], ("kingpin_jacking", "angle_scale")),
    "theta^2": (lambda c: c["steering angle"] ** 2, ("kingpin_jacking", "angle_offset")),
    "theta^3": (lambda c: c["steering angle"] ** 3, ("end_stop", "soil_shear")),
    "omega": (lambda c: c["steering rate"], ("viscous_friction", "line_loss_linear")),
    "omega |omega|": (lambda c: c["steering rate"] * np.abs(c["steering rate"]), ("line_loss_quadratic",)),
    "sgn omega": (lambda c: c["direction"], ("cylinder_friction", "back_pressure")),
    "sgn omega theta": (lambda c: c["direction"] * c["steering angle"], ("surface_patch",)),
    "|sgn omega|": (lambda c: np.abs(c["direction"]), ("direction_asymmetry",)),
    "sgn omega slip": (lambda c: c["direction"] * c["accumulated slip"], ("wear_polishing", "carcass_heat_sink", "heat_partition")),
    "alpha": (lambda c: c["steering acceleration"], ("yaw_inertia",)),
    "dM/dt": (lambda c: c["torque rate"], ("time_delay", "pressure_lag")),
    "M theta": (lambda c: c["torque"] * c["steering angle"], ("moment_arm_error",)),
    "M theta^2": (lambda c: c["torque"] * c["steering angle"] ** 2, ("moment_arm_error",)),
    "M |omega|": (lambda c: c["torque"] * np.abs(c["steering rate"]), ("flash_temperature",)),
    "M log(1 + dwell)": (lambda c: c["torque"] * np.log1p(c["dwell"]), ("stress_relaxation", "trapped_pressure", "static_ageing")),
    "sgn omega exp(-since / 1 deg)": (
        lambda c: c["direction"] * np.exp(-np.degrees(c["angle since reversal"])),
        ("backlash", "linkage_compliance", "distributed_contact", "payne_softening", "mullins_softening"),
    ),
}  # fmt: skip
"""Terms of the sparse regression and the effects that each of them may stand for."""


class Data(NamedTuple):
    """Inputs by name and residual of the recalibrated model (n,) [N m], and the roles of the samples."""

    inputs: Mapping[str, Array]
    residual: Array
    roles: Split

    @property
    def matrix(self) -> Array:
        """Standardised inputs (n, inputs)."""
        raw = np.column_stack([self.inputs[name] for name in INPUTS])
        return _standard(raw, raw[self.roles.fit])


class Learned(NamedTuple):
    """Prediction of the residual (n,) and the effects it names, None for a method that gives no names."""

    prediction: Array
    names: tuple[str, ...] | None = None


def missing() -> list[str]:
    """A note for each library that is not installed."""
    return [
        f"{name} is left out: it needs {library} (install 'lugre_steering[peers]')"
        for name, (library, _) in METHODS.items() if importlib.util.find_spec(library) is None
    ]  # fmt: skip


def compare(bags: Sequence[Path], vehicle_file: Path) -> dict[str, dict[str, Any]]:
    """Held-out mean squares [N2 m2] before and after each method, its alarm, names and time."""
    vehicle = load(vehicle_file)
    runs = [prepare(read_recording(bag, vehicle.channels), vehicle) for bag in bags]
    problem = Problem(vehicle, runs)
    roles = split(problem)
    weight = np.where(roles.fit, 1.0 / problem.sigma, 0.0)
    start = fit(problem, weight, robust=True, linearisations=25)
    baseline = fit(problem, weight, start=start.x, linearisations=15)
    parts = [slice(a, b) for a, b in zip(problem.edges, problem.edges[1:], strict=False)]
    axes = [coordinates(run, baseline.prediction[part]) for run, part in zip(runs, parts, strict=True)]
    data = Data({name: np.concatenate([bag[name] for bag in axes]) for name in INPUTS}, problem.measured - baseline.prediction, roles)

    begun = time.perf_counter()
    loose = Problem(vehicle, runs, (*calibrations_for(vehicle), KINGPIN, GAIN))
    x = np.concatenate([baseline.x[: len(problem.calibrations)], [0.0, 0.0], baseline.x[len(problem.calibrations) :]])
    free = fit(loose, weight, start=x, linearisations=15, priors=False)
    # The gain scales the measured torque: compare in the units of the measurement.
    learned = Learned(free.prediction - baseline.prediction)
    found = {"recalibration": _judged(data, learned, time.perf_counter() - begun)}
    for name, (library, method) in METHODS.items():
        if importlib.util.find_spec(library) is None:
            continue
        begun = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            learned = method(data)
        found[name] = _judged(data, learned, time.perf_counter() - begun)
    return found


def _judged(data: Data, learned: Learned, seconds: float) -> dict[str, Any]:
    held = data.roles.held
    before, after = data.residual[held] ** 2, (data.residual - learned.prediction)[held] ** 2
    gain = np.bincount(data.roles.cluster[held], before - after)
    present = gain[np.unique(data.roles.cluster[held])]
    draws = np.random.default_rng(0).choice(present, (1000, present.size)).sum(axis=1)
    alarm = bool(after.mean() < (1.0 - ALARM_GAIN) * before.mean() and np.percentile(draws, 2.5) > 0.0)
    names = None if learned.names is None else list(learned.names) if alarm else []
    return {"before": float(before.mean()), "after": float(after.mean()), "alarm": alarm, "names": names, "seconds": seconds}


def _standard(value: Array, reference: Array) -> Array:
    return np.asarray((value - reference.mean(axis=0)) / np.maximum(reference.std(axis=0), 1e-12))


def _spread(roles: Split, count: int) -> NDArray[np.int64]:
    """Evenly spread indices of fit samples."""
    at = np.flatnonzero(roles.fit)
    return np.asarray(at[np.linspace(0, at.size - 1, min(count, at.size)).astype(int)])


def sindy(data: Data) -> Learned:
    """Ensemble of thresholded least squares over LIBRARY (pysindy)."""
    import pysindy

    theta = np.column_stack([term(data.inputs) for term, _ in LIBRARY.values()])
    theta /= np.maximum(theta[data.roles.fit].std(axis=0) + np.abs(theta[data.roles.fit].mean(axis=0)), 1e-12)
    scale = float(data.residual[data.roles.fit].std())
    target = data.residual / scale
    fold = data.roles.cluster // 4 % 3

    def ensemble(threshold: float, used: NDArray[np.bool_]) -> Array:
        model = pysindy.EnsembleOptimizer(pysindy.STLSQ(threshold=threshold, alpha=1e-3), bagging=True, n_models=20)
        model.fit(theta[used], target[used][:, None])
        coefficients = np.array(model.coef_list).reshape(20, -1)
        kept = np.mean(coefficients != 0.0, axis=0) >= 0.8
        return np.asarray(np.where(kept, np.median(coefficients, axis=0), 0.0))

    def error(threshold: float) -> float:
        trials = [(ensemble(threshold, data.roles.fit & (fold != k)), data.roles.fit & (fold == k)) for k in range(3)]
        return float(sum(np.sum((target[judge] - theta[judge] @ c) ** 2) for c, judge in trials))

    best = ensemble(min((0.03, 0.1, 0.3), key=error), data.roles.fit)
    if not best.any():
        return Learned(np.zeros_like(target), ())
    size = np.abs(best) * theta[data.roles.fit].std(axis=0)
    return Learned(scale * theta @ best, list(LIBRARY.values())[int(np.argmax(size))][1])


def gaussian_process(data: Data) -> Learned:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    at, inputs = _spread(data.roles, 500), data.matrix
    kernel = ConstantKernel(1.0, (1e-4, 1e3)) * RBF(np.ones(inputs.shape[1]), (0.1, 1e3)) + WhiteKernel(1.0, (1e-3, 10.0))
    model = GaussianProcessRegressor(kernel, normalize_y=True, random_state=0).fit(inputs[at], data.residual[at])
    return Learned(np.asarray(model.predict(inputs)))


def boosted_trees(data: Data) -> Learned:
    from sklearn.ensemble import HistGradientBoostingRegressor

    model = HistGradientBoostingRegressor(
        max_iter=300, learning_rate=0.05, min_samples_leaf=50, early_stopping=True, validation_fraction=0.1, random_state=0
    )
    inputs = data.matrix
    model.fit(inputs[data.roles.fit], data.residual[data.roles.fit])
    return Learned(np.asarray(model.predict(inputs)))


def symbolic_regression(data: Data) -> Learned:
    from gplearn.genetic import SymbolicRegressor

    at, inputs = _spread(data.roles, 1500), data.matrix
    scale = float(data.residual[at].std())
    model = SymbolicRegressor(
        population_size=400, generations=12, parsimony_coefficient=1e-3, random_state=0,
        function_set=("add", "sub", "mul", "div", "abs", "neg", "sin", "sqrt"),
    )  # fmt: skip
    model.fit(inputs[at], data.residual[at] / scale)
    return Learned(scale * np.asarray(model.predict(inputs)))


METHODS: dict[str, tuple[str, Callable[[Data], Learned]]] = {
    "SINDy ensemble": ("pysindy", sindy),
    "Gaussian process": ("sklearn", gaussian_process),
    "boosted trees": ("sklearn", boosted_trees),
    "symbolic regression": ("gplearn", symbolic_regression),
}
"""Library and function of each method."""
