# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The first screen of the report: what, where, how much of the torque, what to do; then the few numbers that carry it."""

from __future__ import annotations

from lugre_steering.counted import counted
from lugre_steering.diagnosis.conclude.headline import bound_to_time
from lugre_steering.diagnosis.report import plots
from lugre_steering.diagnosis.report.names import called
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.report import words
from lugre_steering.report.markup import facts, text
from lugre_steering.report.page import Tone

VERDICTS: dict[str, tuple[str, Tone]] = {
    "consistent": ("No missing physics is seen", "good"),
    "missing_physics": ("Physics is missing from the model", "found"),
    "unlisted_physics": ("Physics is missing that no entry lists", "new"),
    "insufficient_data": ("The data do not decide", "unsure"),
}


def head(diagnosis: Diagnosis) -> str:
    """Verdict in words, and numbers."""
    result = diagnosis.json
    title, _ = VERDICTS[result["verdict"]]
    bags = ", ".join(text(bag) for bag in result["bags"])
    first = result["headline"] or result["statement"]
    rest = result["statement"].removeprefix(first).strip()
    more = f'<p class="more">{text(rest)}</p>' if rest else ""
    return (
        f'<header id="verdict"><p class="over">{text(diagnosis.vehicle.name)} &middot; {bags}</p>\n<h1>{title}</h1>\n'
        f'<div class="verdict"><p>{text(first)}</p>{more}<span class="chip">{text(result["verdict"].replace("_", " "))}</span></div>\n'
        f"{facts(_numbers(diagnosis))}</header>"
    )


def _numbers(diagnosis: Diagnosis) -> list[tuple[str, str, str]]:
    result, vehicle, title = diagnosis.json, diagnosis.vehicle, plots.titles(diagnosis)
    before, after = result["baseline"]["heldout_rmse_Nm"], result["augmented"]["heldout_rmse_Nm"]
    rows = [
        (
            title[found.id],
            f"up to {words.torque(vehicle, found.largest_Nm)}",
            f"{words.percent(found.largest_share)} of the torque",
        )
        for found in diagnosis.found
        if found.largest_Nm is not None
    ]
    if before is None:
        return rows
    noise = f"noise alone: {words.torque(vehicle, result['noise_floor_Nm'])}"
    if diagnosis.found:
        rows.append(("error on held-out data", f"{words.torque(vehicle, before)} → {words.torque(vehicle, after)}", noise))
        ends = result["augmented"]["improvement_ci95"]
        between = f"95 % interval {words.percents(*ends)}" if ends else ""
        rows.append(("improvement", words.percent(result["augmented"]["improvement"]), between))
    else:
        rows.append(("error on held-out data", words.torque(vehicle, before), noise))
    return rows


def next_steps(diagnosis: Diagnosis) -> str:
    """What to do, in order, as HTML."""
    result, steps = diagnosis.json, []
    bad = len(result["data_quality"])
    if result["verdict"] == "insufficient_data":
        steps.append("Put the data right or record again; nothing about the physics can be concluded from these.")
    if bad:
        steps.append(f'Look at <a href="#quality">data quality</a>: {counted(bad, "finding")} about the recording itself.')
    for effect in result["effects"]:
        if effect["indistinguishable_from"]:
            rivals = " or ".join(called(diagnosis, rival, within=True) for rival in effect["indistinguishable_from"])
            steps.append(
                f"Do not rely on the name alone: with these data {rivals} would explain the same as "
                f"{called(diagnosis, effect['id'], within=True)}. The augmented model predicts well either way."
            )
    if nearest := [called(diagnosis, effect["id"], within=True) for effect in result["effects"] if effect["bends"]]:
        steps.append(f"Take {' and '.join(nearest)} as where to look, not as the cause: much is left that no entry of the catalogue is.")
    if {effect["id"] for effect in result["effects"]} & {entry.id for entry in diagnosis.vehicle.effects}:
        momentary = any(bound_to_time(effect["id"], effect["parameters"]) for effect in result["effects"])
        live = (
            "It holds at the times of these recordings only: do not give it to the live node."
            if momentary
            else "The live node publishes the better torque with <code>vehicle_file:=augmented.yaml</code>."
        )
        steps.append(
            "Use the found physics: <code>augmented.yaml</code> beside this page is the vehicle file with it. "
            f"<code>lugre-steering replay BAG --vehicle augmented.yaml --out DIR</code> shows the smaller residual. {live}"
        )
        steps.append("Check it on the machine: the stretches and ranges below say where and when it acts.")
    if diagnosis.laws:
        steps.append(
            "Use the law that was found: <code>augmented.yaml</code> has it under <code>laws</code>, and replay, the live node and the "
            "next diagnosis run it. Replay tells where its coordinate leaves the range seen (finding <code>law_left</code>)."
        )
        steps.append("To keep it under a name of your own: <code>lugre-steering effects --add augmented.yaml --id NAME</code>.")
    if result["verdict"] == "consistent":
        steps.append(
            'Keep the recalibrated baseline (<code>augmented.yaml</code>). What is below the <a href="#limits">detection '
            "limits</a> of these data may still be there."
        )
    if form := result["friction_form"]:
        steps.append(
            f"Try <code>{form['file']}</code>, which has the form of this machine's friction as laws, on a recording that was not "
            "diagnosed. One of them is the level along this ground: take it out where the machine stands on other ground."
        )
    if result["unexplained"]["structured"]:
        steps.append('Look at <a href="#left">what is left</a>: part of the residual is structure, not noise.')
    if result["next_experiment"]:
        steps.append(f'Drive the <a href="#experiment">next experiment</a>: {text(result["next_experiment"]["manoeuvre"])}.')
    return "<ol>" + "".join(f"<li>{step}</li>" for step in steps) + "</ol>\n" if steps else ""
