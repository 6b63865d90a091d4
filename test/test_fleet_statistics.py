# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Joint evidence, changes, trends and the one budget, against independent answers; and what a fleet of records is said to show."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from lugre_steering.data.quality import inspect
from lugre_steering.diagnosis.signed import signed
from lugre_steering.fitting.clocks import synchronised
from lugre_steering.fleet.changes import differences
from lugre_steering.fleet.claims import claims, shared, unusual, worth_pooling
from lugre_steering.fleet.statistics import budgeted, change, combined, outliers, trend
from lugre_steering.fleet.work import nothing
from lugre_steering.resources import config_folder
from lugre_steering.serialise import plain
from lugre_steering.simulate.command import load_vehicle, simulation
from lugre_steering.vehicle import load

SHEET = load(config_folder() / "test_vehicle.yaml")


def test_equal_errors_give_the_mean_and_student_s_interval() -> None:
    value = np.array([1.0, 2.0, 4.0, 5.0])
    whole = combined(value, np.full(4, 0.1), floor=0.0)
    known = stats.ttest_1samp(value, 0.0)  # of values that differ by far more than their errors
    assert whole.value == pytest.approx(3.0)
    assert (whole.low, whole.high) == pytest.approx(tuple(known.confidence_interval(0.95)))
    assert whole.p_value == pytest.approx(known.pvalue)
    assert whole.between == pytest.approx(math.sqrt(value.var(ddof=1) - 0.01))


def test_agreement_never_narrows_the_interval_below_the_errors() -> None:
    whole = combined([1.0, 1.0, 1.0, 1.0], [0.2] * 4, floor=0.0)
    assert whole.high - 1.0 == pytest.approx(stats.t(3).ppf(0.975) * 0.1)
    assert whole.between == 0.0


@pytest.mark.parametrize(("between", "floor"), [(0.0, 0.0), (2.0, None)])
@pytest.mark.parametrize("level", [0.05, 0.005])
def test_nothing_is_found_jointly_as_rarely_as_said(between: float, floor: float | None, level: float) -> None:
    """False alarms over 1000 fleets of six recordings whose errors are known from 16 draws each, with and without differences beyond."""
    rng = np.random.default_rng(3)
    error = rng.uniform(0.5, 2.0, (1000, 6))
    value = rng.normal(0.0, np.sqrt(error**2 + between**2))
    sd = error * np.sqrt(rng.chisquare(16, error.shape) / 16.0)
    false = np.mean([combined(y, s, floor=floor).p_value < level for y, s in zip(value, sd, strict=True)])
    assert false < level + 3.0 * math.sqrt(level * (1.0 - level) / 1000)


def test_five_recordings_that_agree_are_enough() -> None:
    """Each shows five standard deviations: together they beat a thousand names and variants tried."""
    assert combined([4.2, 5.9, 5.1, 4.4, 5.6], [1.0] * 5).p_value < 1e-6
    assert combined([4.2, -5.9, 5.1, -4.4, 5.6], [1.0] * 5).p_value > 0.5


def test_recordings_that_differ_hint_at_what_they_do_not_prove() -> None:
    """Viscous friction of five manoeuvres, as simulated: 750 with more than the errors between them."""
    whole = combined([1320.0, 579.0, 106.0, 706.0, 612.0], [210.0, 26.0, 110.0, 34.0, 81.0])
    assert whole.hint_p < 1e-8
    assert whole.p_value > 1e-3
    assert combined([320.0, -79.0, 106.0, -70.0, 12.0], [210.0, 26.0, 110.0, 34.0, 81.0]).hint_p > 0.1


def test_what_every_estimate_has_wrong_alike_is_no_evidence() -> None:
    sd = np.ones(400)
    assert combined(0.6 * sd, sd, floor=0.0).p_value < 1e-12
    assert combined(0.6 * sd, sd).p_value > 0.9
    assert combined(1.6 * sd, sd).p_value < 1e-12


def test_one_sided_where_no_other_sign_is_possible() -> None:
    assert combined([-3.0, -3.1, -2.9, -3.0], [0.1] * 4, sign=1).p_value > 0.99


def test_the_budget_is_that_of_benjamini_and_yekutieli() -> None:
    p = np.random.default_rng(5).uniform(size=50) ** 4
    assert budgeted(p) == pytest.approx(stats.false_discovery_control(p, method="by"))
    assert budgeted(p, np.full(50, 1.0)) == pytest.approx(budgeted(p))
    assert budgeted([]).size == 0


def test_a_step_is_found_where_it_is_and_chance_makes_none() -> None:
    rng = np.random.default_rng(8)
    noise = rng.normal(0.0, 1.0, 14)
    step = change(noise + 4.0 * (np.arange(14) >= 9), np.ones(14), 1)
    assert step is not None
    assert step.first == 9
    assert step.p_value < 0.005
    assert change(noise[:5], np.ones(5), 1) is None
    chance = [change(rng.normal(size=10), np.ones(10), 1).p_value for _ in range(60)]  # type: ignore[union-attr]
    assert stats.kstest(chance, "uniform").pvalue > 0.001


def test_trends_and_outliers() -> None:
    days = np.arange(12.0)
    line = trend(days, 2.0 * days + np.array([0.0, 1.0] * 6))
    assert line is not None
    assert line.slope == pytest.approx(2.0, abs=0.2)
    assert line.p_value < 1e-4
    assert trend(np.ones(12), days) is None
    assert trend(days[:7], days[:7]) is None
    assert list(outliers(np.array([1.0, 1.1, 0.9, 1.05, 9.0, 1.0]))) == [False] * 4 + [True, False]


# ------------------------------------------------------------------ claims


def record(vehicle: str, day: int, estimates: dict[str, float], rmse: float = 100.0, **other: object) -> dict:
    rows = [
        {"effect": effect, "shape": 0, "parameter": "size", "unit": "N m", "value": value, "sd": 1.0, "sign": 0,
         "each_Nm": 30.0, "each_share": 0.01}
        for effect, value in estimates.items()
    ]
    inputs = f"{vehicle} {day}"
    return {
        **nothing(""), "quarantine": None, "member": vehicle, "bag": f"bags/{inputs}", "inputs": inputs, "version": "1",
        "made": "2026-01-01",
        "recorded": f"2026-03-{day:02d}T10:00:00+00:00", "verdict": "consistent", "air_degC": 20.0 + day % 3, "estimates": rows,
        "score": {"rmse_Nm": rmse, "bias_Nm": 0.0, "r2": 0.9, "samples": 10}, **other,
    }  # fmt: skip


def fleet_of_two(days: int = 25) -> list[dict]:
    """The first vehicle has 2.5 standard deviations of slope_bias in each recording; the second gets backlash in mid-month."""
    rng = np.random.default_rng(2)
    first = [record("A", d, {"slope_bias": rng.normal(2.8), "backlash": rng.normal()}, rmse=100.0 + 3.0 * d) for d in range(1, days + 1)]
    second = [record("B", d, {"slope_bias": rng.normal(), "backlash": rng.normal(7.0 if d > 15 else 0.0)}) for d in range(1, days + 1)]
    return [*first, *second]


def test_a_claim_keeps_what_its_recording_cannot_tell_it_from() -> None:
    size = {"offset": {"value": 2e4, "ci95": [1e4, 3e4], "unit": "Pa"}}
    effect = {"id": "pressure_offset", "p_value": 1e-9, "parameters": size, "indistinguishable_from": ["slope_bias", "direction_asymmetry"],
              "largest_Nm": 300.0, "largest_share": 0.01}  # fmt: skip
    (claim,) = claims([record("A", 1, {}, effects=[effect])])
    assert claim.rivals == "slope_bias, direction_asymmetry"


def test_what_is_too_weak_in_each_and_present_in_all_is_found() -> None:
    found = [claim for claim in claims(fleet_of_two()) if claim.stands]
    joint = [(claim.vehicle, claim.effect) for claim in found if claim.kind == "joint"]
    assert ("A", "slope_bias") in joint
    assert ("A", "backlash") not in joint
    assert ("B", "slope_bias") not in joint
    leader = next(claim for claim in found if claim.leads and claim.vehicle == "A")
    assert leader.low < 2.8 < leader.high
    assert leader.named_in == 0


def test_since_when() -> None:
    found = [claim for claim in claims(fleet_of_two()) if claim.stands and claim.kind == "since"]
    assert [(claim.vehicle, claim.effect, claim.since[:10]) for claim in found] == [("B", "backlash", "2026-03-16")]


def test_a_trend_over_dates_stands_and_one_over_temperature_does_not() -> None:
    found = [claim for claim in claims(fleet_of_two()) if claim.stands and claim.kind.startswith("trend")]
    assert [(claim.vehicle, claim.kind, claim.effect) for claim in found] == [("A", "trend over time", "rmse")]
    assert found[0].value == pytest.approx(3.0)


def test_what_is_too_weak_on_every_vehicle_and_alike_on_all_is_found() -> None:
    rng = np.random.default_rng(6)
    rows = [record(v, d, {"slope_bias": rng.normal(2.6), "backlash": rng.normal()}) for v in "ABCDEFGHIJ" for d in range(1, 5)]
    found = [claim for claim in claims(rows) if claim.stands]
    assert [(claim.kind, claim.vehicle, claim.effect, claim.leads) for claim in found] == [("fleet", "", "slope_bias", True)]
    assert found[0].low < 2.6 < found[0].high
    assert found[0].largest_Nm == pytest.approx(30.0 * found[0].value)
    one = [record(v, d, {"slope_bias": rng.normal(30.0 if v == "A" else 0.0)}) for v in "ABCDEFGHIJ" for d in range(1, 5)]
    assert {(claim.kind, claim.vehicle) for claim in claims(one) if claim.stands} == {("joint", "A")}


def test_what_several_recordings_show_together_leads_and_is_looked_at_where_hardly_any_names_it() -> None:
    rng = np.random.default_rng(7)
    rows = [record("A", d, {"slope_bias": rng.normal(4.0), "backlash": rng.normal(5.0)}) for d in range(1, 9)]
    for day, row in enumerate(rows):
        row["estimates"] = [{**one, "sd": 1.0 + 0.1 * (day not in (1, 2, 4, 6, 7))} for one in row["estimates"]]
    (chosen,) = worth_pooling(rows).values()
    assert [row["bag"] for row in chosen] == [f"bags/A {day}" for day in (2, 3, 5, 7, 8)]  # which say most
    assert not worth_pooling(rows[:2])
    size = {"slope": {"value": 4.0, "ci95": [3.0, 5.0], "unit": "N m"}}
    effect = {"id": "slope_bias", "p_value": 1e-12, "parameters": size, "indistinguishable_from": [], "largest_Nm": 120.0,
              "largest_share": 0.04}  # fmt: skip
    pooled = {"member": "A", "bags": ["a", "b"], "recorded": "2026-03-01", "effects": [effect]}
    leading = [claim for claim in claims(rows, together=[pooled]) if claim.leads]
    assert [(claim.kind, claim.effect, claim.recordings, claim.largest_Nm) for claim in leading] == [("together", "slope_bias", 2, 120.0)]
    for row in rows:
        row["effects"] = [effect]  # named in each: nothing more is to be learnt
    assert not worth_pooling(rows)
    differing = [{**row, "effects": [{**effect, "id": f"other_{day}"}]} for day, row in enumerate(rows)]
    assert worth_pooling(differing)  # each names something else
    assert [claim.effect for claim in claims(rows) if claim.leads] == ["slope_bias"]


def test_shared_against_vehicle_specific() -> None:
    rng = np.random.default_rng(4)
    backlash = {"A": 6.0, "B": 0.0}
    both = [record(v, d, {"slope_bias": rng.normal(4.0), "backlash": rng.normal(backlash[v])}) for v in "AB" for d in range(1, 21)]
    told = {one.effect: one for one in shared(both, claims(both))}
    assert told["slope_bias"].common
    assert told["slope_bias"].vehicles == ("A", "B")
    assert not told["backlash"].common
    assert told["backlash"].vehicles == ("A",)


def test_a_fleet_without_physics_claims_nothing() -> None:
    """Not in one of twenty, where a claim in one would be the budget."""
    claimed = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        rows = [record(v, d, {name: rng.normal() for name in ("slope_bias", "backlash", "end_stop")}) for v in "AB" for d in range(1, 13)]
        claimed += any(claim.stands for claim in claims(rows))
    assert claimed <= 2


def test_copies_count_once_and_outliers_are_told() -> None:
    rows = [record("A", d, {"slope_bias": 4.0 + 0.1 * d}, rmse=100.0 + d) for d in range(1, 9)]
    rows[3]["score"]["rmse_Nm"] = 900.0
    doubled = [*rows, *({**row, "bag": f"{row['bag']} copy"} for row in rows)]
    assert claims(doubled) == claims(rows)
    assert [one.bag for one in unusual(rows)] == ["bags/A 4"]


def test_differences_of_two_versions() -> None:
    effect = {"id": "backlash", "p_value": 0.001, "parameters": {"width": {"value": 0.01, "ci95": [0.0, 0.02], "unit": "rad"}}}
    old = {row["inputs"]: row for row in (record("A", 1, {}), record("A", 2, {}), record("A", 3, {}, effects=[effect]))}
    changed = {**effect, "parameters": {"width": {**effect["parameters"]["width"], "value": 0.02}}}
    new = [
        record("A", 1, {}, version="2"), record("A", 2, {}, version="2", verdict="missing_physics", effects=[effect], rmse=90.0),
        record("A", 3, {}, version="2", effects=[changed]), record("A", 4, {}, version="2"),
    ]  # fmt: skip
    found = [(one.bag, one.what, one.before, one.after) for one in differences(new, old)]
    assert found == [
        ("bags/A 2", "verdict", "consistent", "missing_physics"),
        ("bags/A 2", "rmse_Nm", "100", "90"),
        ("bags/A 2", "effect backlash", "not named", "named, p 0.001"),
        ("bags/A 3", "effect backlash: width [rad]", "0.01", "0.02"),
    ]


# --------------------------------------------------------- real estimates


def of_recordings(effects: list[str], count: int) -> list[dict]:
    """Signed estimates of recordings whose simulated vehicle has more than its sheet."""
    vehicle = load_vehicle(None, effects)
    rows = []
    for k in range(count):
        recording = simulation("double-cycle", vehicle, {"seed": 100 + k, "angle_rate_Hz": 50, "pressure_rate_Hz": 50}).recording
        problem = synchronised([inspect(recording, SHEET).recording], SHEET).problem
        rows.append({**record("A", k + 1, {}, verdict=None), "estimates": plain(signed(problem, k))})
    return rows


def test_a_weak_effect_of_simulated_recordings_is_named_jointly_with_its_size() -> None:
    """A thirtieth of a typical asymmetry, which the diagnosis of one such recording calls consistent."""
    leader = next(claim for claim in claims(of_recordings(["direction_asymmetry:asymmetry=0.0005"], 8)) if claim.leads)
    assert leader.effect == "direction_asymmetry"
    assert leader.low < 0.0005 < leader.high
    assert leader.high < 0.001


def test_recordings_that_hide_nothing_show_nothing_jointly() -> None:
    assert not [claim for claim in claims(of_recordings([], 5)) if claim.stands]
