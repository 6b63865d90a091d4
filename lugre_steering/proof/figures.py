# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of the scoreboard: power, confusion, place, parameters, and effect by effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.files import MAKER
from lugre_steering.proof.scoreboard import OUTCOMES, TARGETS
from lugre_steering.provenance import Provenance, Source
from lugre_steering.report.style import SERIES, figure, whole_ticks

Board = Mapping[str, Any]
VERDICTS = [name for name in OUTCOMES if name not in ("right name", "wrong name", "extra name")]


@dataclass(frozen=True)
class Origin:
    """How the cases of a picture came about: ``said`` below it, ``by`` inside its file."""

    said: str
    by: Provenance


def draw_all(board: Board, folder: Path) -> list[Path]:
    """Write the pictures of every simulator for which the board has cases; returns their files."""
    return [file for number, part in board["simulators"].items() for file in _draw_part(board["made"], number, part, folder)]


def _draw_part(how: Mapping[str, Any], number: str, board: Board, folder: Path) -> list[Path]:
    cases = sum(board["cases"].values())
    said = f"Synthetic recordings of simulator {number}, {cases} cases, diagnosed blind. Seed {how['seed']}, {how['date']}."
    made = Origin(said, _provenance(how))
    wanted = {
        "power": (draw_power, any(power["detected"]["of"] for power in board["power"])),
        "confusion": (draw_confusion, bool(board["naming"]["confusion"])),
        "location": (draw_location, bool(board["location"]["values"])),
        "parameters": (draw_parameters, bool(board["parameters"]["error"])),
        "effects": (draw_effects, bool(board["effects"])),
        "peers": (draw_peers, bool(board["peers"])),
    }
    files = []
    for name, (draw, there) in wanted.items():
        if there:
            files.append(folder / f"proof{'' if number == '2' else number}_{name}.png")
            draw(board, files[-1], made)
    return files


def _provenance(how: Mapping[str, Any]) -> Provenance:
    """What the board says of its own making, as far as it does."""
    version = how.get("versions", {}).get(MAKER, "")
    options = {name: how[name] for name in ("command", "seed", "source") if name in how}
    sheet = Source(**how["vehicle"]) if "vehicle" in how else None
    return Provenance(f"{MAKER} {version}".strip(), "prove", how["date"], options, sheet, ())


def draw_power(board: Board, file: Path, made: Origin) -> None:
    """Share detected and share rightly named against effect-to-noise ratio, with 95 % intervals; nulls as false alarms."""
    nulls = board["nulls"]["silent"]
    alarms = "" if nulls["share"] is None else f" False alarms on nulls: {nulls['of'] - nulls['hits']} of {nulls['of']}."
    caption = (
        "Bars: 95 % Wilson intervals. The ratio is the variance an effect adds to the torque after the baseline is recalibrated, over the "
        f"variance of the measurement noise.{alarms}\n{made.said}"
    )
    with figure(1, 1, caption, file, made=made.by, row_inches=4.0, width=8.0) as axes:
        axis = axes[0, 0]
        curves = {
            "detected": [power["detected"] for power in board["power"]],
            "right name or tie": [power["right"] for power in board["power"]],
            "unlisted called unlisted": board["unlisted"]["by_ratio"],
        }
        ratios = [power["ratio"] for power in board["power"]]
        for k, (label, scores) in enumerate(curves.items()):
            shown = [(ratio * 1.06 ** (k - 1), s) for ratio, s in zip(ratios, scores, strict=True) if s["of"]]
            if shown:
                x, shares = [r for r, _ in shown], np.array([s["share"] for _, s in shown])
                ends = np.array([s["ci95"] for _, s in shown]).T
                axis.errorbar(x, shares, np.abs(ends - shares), marker="o", capsize=3, color=SERIES[k], label=label)
        wanted = [TARGETS["named_at_0.1"].value, TARGETS["named_from_0.3"].value]
        axis.plot([0.1, 0.3], wanted, "k_", markersize=16, label="target for names")
        axis.set(xscale="log", ylim=(-0.02, 1.04), title="Detection power")
        axis.set_xticks(ratios)
        axis.set(xlabel="effect-to-noise variance ratio", ylabel="share of cases")
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.0)  # bars may be anywhere inside


def draw_confusion(board: Board, file: Path, made: Origin) -> None:
    """True effect against answer."""
    table = board["naming"]["confusion"]
    given = {answer for row in table.values() for answer in row}
    rows = list(table)
    names = [*rows, *sorted(given - set(rows) - set(VERDICTS))]
    columns = [name for name in names if name in given] + [verdict for verdict in VERDICTS if verdict in given]
    counts = np.array([[table[row].get(column, 0) for column in columns] for row in rows])
    caption = (
        "Effects at a ratio of 0.3 and above. A row is what was hidden, a column what was answered; 'right tie' means that the truth is "
        f"among the names the engine says it cannot tell apart. A dot marks the right column.\n{made.said}"
    )
    with figure(1, 1, caption, file, made=made.by, row_inches=0.24 * len(rows) + 2.2, width=max(0.3 * len(columns) + 4.0, 7.0)) as axes:
        right = [["right tie", row] if row in board["effects"] and row not in _unlisted(board) else ["unlisted"] for row in rows]
        shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
        _matrix(axes[0, 0], shares, [[str(n) if n else "" for n in row] for row in counts])
        for i, answers in enumerate(right):
            for j in [columns.index(answer) for answer in answers if answer in columns]:
                axes[0, 0].plot(j + 0.36, i - 0.33, ".", color=SERIES[1], markersize=4)
        axes[0, 0].set_xticks(range(len(columns)), columns, rotation=90, fontsize=7.5)
        axes[0, 0].set_yticks(range(len(rows)), rows, fontsize=7.5)
        axes[0, 0].set(title="What was hidden and what was answered", xlabel="answer", ylabel="truth")


def draw_location(board: Board, file: Path, made: Origin) -> None:
    """Histogram of intersection over union."""
    caption = (
        "Time in which the effect acts by more than 5 % of its largest torque, true against reported, for effects that act in less than "
        f"60 % of the time.\n{made.said}"
    )
    with figure(1, 1, caption, file, made=made.by, row_inches=3.2, width=7.0) as axes:
        axes[0, 0].hist(board["location"]["values"], np.linspace(0.0, 1.0, 21), color=SERIES[0])
        whole_ticks(axes[0, 0].yaxis)
        axes[0, 0].axvline(TARGETS["location_iou"].value, color="k", linestyle="--", label="target")
        axes[0, 0].set(xlabel="intersection over union", ylabel="cases", title="Place in time")
        axes[0, 0].legend()


def draw_parameters(board: Board, file: Path, made: Origin) -> None:
    """Median and quartiles of the relative error of each parameter."""
    errors = board["parameters"]["error"]
    caption = f"Dot: median; line: quartiles; number: cases. Only parameters that mean the same in both laws.\n{made.said}"
    with figure(1, 1, caption, file, made=made.by, row_inches=0.22 * len(errors) + 1.0, width=8.0) as axes:
        for i, entry in enumerate(errors.values()):
            axes[0, 0].plot(np.maximum(entry["quartiles"], 1e-3), [i, i], color=SERIES[0])
            axes[0, 0].plot(max(entry["median"], 1e-3), i, "o", color=SERIES[0])
            axes[0, 0].annotate(str(entry["of"]), (1.01, i), xycoords=("axes fraction", "data"), fontsize=7.5, va="center")
        axes[0, 0].axvline(TARGETS["parameter_error"].value, color="k", linestyle="--")
        axes[0, 0].set_yticks(range(len(errors)), list(errors), fontsize=7.5)
        axes[0, 0].set(xscale="log", ylim=(len(errors) - 0.5, -0.5), xlabel="relative error")
        axes[0, 0].set_title("Parameters against the truth (dashed: 10 %)")


def draw_effects(board: Board, file: Path, made: Origin) -> None:
    """Every effect at every size and in every disguise: how many were answered rightly."""
    effects = board["effects"]
    cells = list(next(iter(effects.values()))["right"])
    shares = np.array([[right / of if of else np.nan for right, of in entry["right"].values()] for entry in effects.values()])
    texts = [[f"{right}/{of}" if of else "" for right, of in entry["right"].values()] for entry in effects.values()]
    caption = (
        "Right name or tie (unlisted physics: called unlisted) of all cases; columns: effect-to-noise ratio after recalibration, then "
        f"disguises.\n{made.said}"
    )
    with figure(1, 1, caption, file, made=made.by, row_inches=0.24 * len(effects) + 1.2, width=8.0) as axes:
        _matrix(axes[0, 0], shares, texts)
        axes[0, 0].set_xticks(range(len(cells)), cells, fontsize=8.5)
        axes[0, 0].set_yticks(range(len(effects)), list(effects), fontsize=7.5)
        axes[0, 0].set_title("Effect by effect")


def draw_peers(board: Board, file: Path, made: Origin) -> None:
    """Error removed against false alarms for every method."""
    caption = f"Held-out error removed: median over effects at a ratio of 0.3 and above. False alarms: share of nulls.\n{made.said}"
    with figure(1, 1, caption, file, made=made.by, row_inches=3.6, width=7.0) as axes:
        for k, (name, entry) in enumerate(board["peers"].items()):
            x, y = entry["false_alarms"]["share"], entry["removed"]["median"]
            if x is not None and y is not None:
                axes[0, 0].plot(x, y, "o", color=SERIES[k % len(SERIES)], label=name)
        axes[0, 0].set(xlim=(-0.03, 1.03), xlabel="false alarms on nulls", ylabel="held-out error removed")
        axes[0, 0].set_title("Peers on the same recordings")
        axes[0, 0].legend(loc="best")


def _unlisted(board: Board) -> set[str]:
    from lugre_steering.proof.conceal import UNLISTED_IDS

    return set(UNLISTED_IDS) & set(board["effects"])


DARK = 0.65
"""Share from which a cell is so dark that black would not be read on it."""


def _matrix(axis: Any, shares: Any, texts: Sequence[Sequence[str]]) -> None:
    """A table with shaded cells (1 darkest)."""
    axis.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.3, aspect="auto")
    axis.grid(visible=False)
    for i, row in enumerate(texts):
        for j, text in enumerate(row):
            colour = "white" if shares[i][j] > DARK else "black"
            axis.text(j, i, text, ha="center", va="center", fontsize=7, color=colour)
