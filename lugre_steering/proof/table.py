# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The scoreboard as tables: on a terminal, and in README."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from lugre_steering.proof.campaign import RATIOS

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
    """Targets first, then what they are made of."""
    done, planned = sum(board["cases"].values()), board["made"]["planned_cases"]
    targets = Table(title=f"{done} of {planned} cases, seed {board['made']['seed']}")
    for name in ("score", "reached", "target", ""):
        targets.add_column(name, justify="left" if name == "score" else "right")
    for target in board["targets"]:
        reached = "-" if target["reached"] is None else f"{target['reached']:.2f}"
        met = {None: Text(), True: Text("met", "green"), False: Text("not met", "red")}[target["met"]]
        targets.add_row(target["what"], reached, f"{target['target']:.2f}", met)
    console.print(targets)
    scores = Table("score", "share (count, 95 % interval) or median (quartiles, count)")
    scores.add_row("nulls silent", share(board["nulls"]["silent"]))
    for noise, score in board["nulls"]["by_noise"].items():
        scores.add_row(f"  {noise} noise", share(score))
    scores.add_row("  held-out error over noise (mean square)", median(board["nulls"]["heldout_over_noise"]))
    for power in board["power"]:
        scores.add_row(f"detected at effect-to-noise {power['ratio']:g}", share(power["detected"]))
        scores.add_row("  right name or tie", share(power["right"]))
    for kind, score in board["disguises"].items():
        scores.add_row(f"right name or tie, {kind}", share(score))
    for band in board["masked"]:
        scores.add_row(f"right name or tie, masked share {band['masked']}", share(band))
    scores.add_row("both of two effects", share(board["pairs"]["both"]))
    scores.add_row("  each 0.3 and above beside the other", share(board["pairs"]["both_from_0.3"]))
    scores.add_row("unlisted called unlisted", share(board["unlisted"]["called_unlisted"]))
    scores.add_row("location IoU", median(board["location"]["listed"]))
    scores.add_row("location IoU, unlisted", median(board["location"]["unlisted"]))
    scores.add_row("parameters within 10 %", share(board["parameters"]["within_10_percent"]))
    scores.add_row("95 % interval covers the true parameter", share(board["parameters"]["interval_covers"]))
    scores.add_row("removable held-out error removed", median(board["removed"]["from_0.3"]))
    scores.add_row("seconds per diagnosis", median(board["seconds_per_case"]))
    console.print(scores)
    _show_effects(console, board)
    if board["peers"]:
        _show_peers(console, board["peers"])
    for failure in board["failed"]:
        console.print(f"failed: {failure['name']} (seed {failure['seed']}): {failure['error']}")


def _show_effects(console: Console, board: Row) -> None:
    cells = list(next(iter(board["effects"].values()))["right"]) if board["effects"] else []
    table = Table("effect", *cells, "taken for", title="right of all, by effect-to-noise ratio and disguise")
    for effect, entry in board["effects"].items():
        counts = [f"{right}/{of}" if of else "" for right, of in (entry["right"][cell] for cell in cells)]
        table.add_row(effect, *counts, ", ".join(f"{name} {n}" for name, n in entry["taken_for"].items()))
    console.print(table)


def _show_peers(console: Console, peers: Row) -> None:
    table = Table("method", "held-out error removed", "false alarms", "right name", "seconds", title="on the same recordings")
    for name, entry in peers.items():
        table.add_row(name, median(entry["removed"]), share(entry["false_alarms"]), share(entry["named"]), median(entry["seconds"]))
    console.print(table)


def readme_lines(board: Row) -> list[str]:
    """What README shows, so that its numbers come from the kept scoreboard: targets, peers, and the cells that fall short."""
    sign = {"parameter_error": "at most"}
    behind: dict[str, str] = {
        "nulls_silent": share(board["nulls"]["silent"]),
        "named_from_0.3": share(board["naming"]["from_0.3"]),
        "named_at_0.1": share(next(power["right"] for power in board["power"] if power["ratio"] == RATIOS[0])),
        "location_iou": median(board["location"]["listed"]),
        "parameter_error": median(board["parameters"]["all"]),
        "removed": median(board["removed"]["from_0.3"]),
        "both_of_two": share(board["pairs"]["both"]),
        "unlisted": share(board["unlisted"]["called_unlisted"]),
    }
    lines = ["| score | reached | target |", "|---|---|---|"]
    lines += [f"| {t['what']} | {behind[t['id']]} | {sign.get(t['id'], 'at least')} {t['target']:.2f} |" for t in board["targets"]]
    beside = {
        "parameters within 10 %": share(board["parameters"]["within_10_percent"]),
        "95 % interval covers the true parameter": share(board["parameters"]["interval_covers"]),
        "places of local effects with an IoU above 0.7": share(board["location"]["above_0.7"]),
        "both of two effects, each 0.3 and above beside the other": share(board["pairs"]["both_from_0.3"]),
        **{f"right name or tie, {kind}": share(score) for kind, score in board["disguises"].items()},
        "seconds per diagnosis on one thread": median(board["seconds_per_case"]),
    }
    lines += [f"| {what} | {value} | |" for what, value in beside.items()]
    if board["peers"]:
        lines += ["", "| method | held-out error removed | false alarms on nulls | right name | seconds |", "|---|---|---|---|---|"]
        lines += [
            f"| {name} | {median(peer['removed'])} | {share(peer['false_alarms'])} | {share(peer['named'])} | {median(peer['seconds'])} |"
            for name, peer in board["peers"].items()
        ]
    cells = [f"{ratio:g}" for ratio in RATIOS] + ["one-bag", "late", "barely"]
    short = {
        effect: entry for effect, entry in board["effects"].items()
        if any(right < of for cell, (right, of) in entry["right"].items() if cell != cells[0])
    }  # fmt: skip
    if short:
        lines += ["", f"| right of all | {' | '.join(cells)} | taken for |", "|---" * (len(cells) + 2) + "|"]
    for effect, entry in short.items():
        counts = [f"{right}/{of}" if of else "" for right, of in (entry["right"][cell] for cell in cells)]
        taken = ", ".join(f"{name} {count}" for name, count in entry["taken_for"].items())
        lines.append(f"| {effect} | {' | '.join(counts)} | {taken} |")
    return lines
