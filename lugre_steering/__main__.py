# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""``python -m lugre_steering``: the command line where no console script is on the path."""

from lugre_steering.cli import main

if __name__ == "__main__":
    main()
