# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""``python -m lugre_steering.bench``: runs one benchmark by name, or all of them one after the other."""

from __future__ import annotations

import importlib
import sys

NAMES = ("kernel", "replay", "fleet", "live", "own_error", "fuzz", "untold", "faults", "soak", "watch", "closed_loop", "joints", "same")


def main(arguments: list[str]) -> int:
    """Run the named benchmark with the remaining arguments; without a name, all of them."""
    if arguments[:1] in (["-h"], ["--help"]):
        print(f"usage: python -m lugre_steering.bench [{'|'.join(NAMES)}] [--json] [options of the named one: its --help]\n\n{__doc__}")
        return 0
    if arguments and arguments[0] in NAMES:
        chosen, rest = arguments[:1], arguments[1:]
    elif arguments and not arguments[0].startswith("-"):
        print(f"bench: got '{arguments[0]}', expected one of {', '.join(NAMES)}", file=sys.stderr)
        return 2
    else:
        chosen, rest = list(NAMES), arguments
    for name in chosen:
        importlib.import_module(f"lugre_steering.bench.{name}").run(rest)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
