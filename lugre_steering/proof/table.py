# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The scoreboard as tables on a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from lugre_steering.counted import counted

Row = Mapping[str, Any]


def share(score: Row) -> str:
    """'0.93 (14 of 15, 0.70 to 0.99)'."""
    if score["share"] is None:
        return "-"
    low, high = score["ci95"]
    return f"{score['share']:.2f} ({score['hits']} of {score['of']}, {low:.2f} to {high:.2f})"


def median(score: Row) -> str:
    """'0.85 (0.70 to 0.93, 12)': median, quartiles, count."""
    if score["median"] is None:
        return "-"
    low, high = score["quartiles"]
    return f"{score['median']:.3g} ({low:.3g} to {high:.3g}, {score['of']})"


def show_board(console: Console, board: Row) -> None:
    """For each simulator: targets first, then what they are made of."""
    done, planned = sum(board["cases"].values()), board["made"]["planned_cases"]
    console.print(f"{done} of {planned} cases, seed {board['made']['seed']}")
    for number, part in board["simulators"].items():
        _show_targets(console, number, part)
        _show_scores(console, part)
        _show_effects(console, part)
        if part["peers"]:
            _show_peers(console, part["peers"])
    for failure in board["failed"]:
        console.print(f"failed: {failure['name']} (seed {failure['seed']}): {failure['error']}")


def told(score: Row) -> str:
    """A share or a median with its count and interval."""
    return share(score) if "share" in score else median(score)


def _show_targets(console: Console, number: str, part: Row) -> None:
    table = Table(title=f"simulator {number}: {counted(sum(part['cases'].values()), 'case')}")
    for name in ("score", "reached", "target", ""):
        table.add_column(name, justify="left" if name == "score" else "right")
    colour = {"met": "green", "not met": "red", "too few cases": "yellow", None: ""}
    for target in part["targets"]:
        limit = f"{'at most' if target['most'] else 'at least'} {target['target']:g}"
        table.add_row(target["what"], told(target["score"]), limit, Text(target["status"] or "", colour[target["status"]]))
    console.print(table)


def details(part: Row) -> dict[str, Row]:
    """Scores beside the targets, by what they say."""
    rows: dict[str, Row] = {f"nulls silent, {noise} noise": score for noise, score in part["nulls"]["by_noise"].items()}
    rows["held-out error over noise in nulls (mean square)"] = part["nulls"]["heldout_over_noise"]
    for power in part["power"]:
        rows[f"detected at effect-to-noise {power['ratio']:g}"] = power["detected"]
        rows[f"right name or tie at {power['ratio']:g}"] = power["right"]
    rows |= {f"right name or tie, masked share {band['masked']}": band for band in part["masked"]}
    rows["both of two effects, each 0.3 and above beside the other"] = part["pairs"]["all_from_0.3"]
    rows["all of three effects, each 0.3 and above beside the others"] = part["triples"]["all_from_0.3"]
    rows["generated laws inside the grammar called unlisted"] = part["laws"]["inside_grammar"]
    rows["generated laws outside the grammar called unlisted"] = part["laws"]["outside_grammar"]
    rows["generated laws with a memory called unlisted"] = part["laws"]["with_memory"]
    rows["dirty nulls blamed on the sheet"] = part["dirty"]["blamed_on_the_sheet"]
    rows["wrong sheets: a finding"] = part["sheets"]["finding"]
    rows["wrong sheets: nothing named"] = part["sheets"]["named_nothing"]
    rows |= {f"wrong sheets: {what}": score for what, score in part["sheets"]["by_mistake"].items()}
    rows["entry taken away: nine tenths of what it removes are removed without it"] = part["without"]["enough"]
    rows["entry taken away: removed where laws stand (median)"] = part["without"]["by_laws"]
    rows["coefficients within 10 %"] = part["parameters"]["within_10_percent"]
    rows["measurable quantities within 10 %"] = part["measurable"]["within_10_percent"]
    rows["half width of their intervals (relative, median)"] = part["measurable"]["half_width"]
    rows["places of local effects with an IoU above 0.7"] = part["location"]["above_0.7"]
    rows["location IoU, unlisted"] = part["location"]["unlisted"]
    return {what: score for what, score in rows.items() if score["of"]}


def _show_scores(console: Console, part: Row) -> None:
    scores = Table("score", "share (count, 95 % interval) or median (quartiles, count)")
    for what, score in details(part).items():
        scores.add_row(what, told(score))
    console.print(scores)


def _show_effects(console: Console, part: Row) -> None:
    cells = list(next(iter(part["effects"].values()))["right"]) if part["effects"] else []
    table = Table("effect", *cells, "taken for", title="right of all, by effect-to-noise ratio and disguise")
    for effect, entry in part["effects"].items():
        counts = [f"{right}/{of}" if of else "" for right, of in (entry["right"][cell] for cell in cells)]
        table.add_row(effect, *counts, ", ".join(f"{name} {n}" for name, n in entry["taken_for"].items()))
    console.print(table)


def _show_peers(console: Console, peers: Row) -> None:
    table = Table("method", "held-out error removed", "false alarms", "right name", "seconds", title="on the same recordings")
    for name, entry in peers.items():
        table.add_row(name, median(entry["removed"]), share(entry["false_alarms"]), share(entry["named"]), median(entry["seconds"]))
    console.print(table)
