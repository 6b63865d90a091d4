# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""One BLAS thread, as the command line asks for, and one for fits where tests run side by side; set before NumPy is imported."""
import gc
import os
from collections.abc import Iterator

import pytest
from catalogue import put_back
from hypothesis import HealthCheck, settings

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ["LUGRE_STEERING_CONFIG"] = "/nowhere/defaults.yaml"  # what a developer has saved changes no test
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("LUGRE_STEERING_THREADS", "1")
# Other tests have the processors as well: how long an example takes says nothing.
settings.register_profile("shared", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("shared")

LONGEST = (
    "test_engine_names.py", "test_reality.py", "test_rigs.py", "test_engine.py", "test_fleet.py", "test_replay.py", "test_library.py",
    "test_own_physics.py", "test_laws_found.py", "test_search_parts.py", "test_scoreboard.py", "test_emps.py", "test_simulator.py",
    "test_readme.py", "test_form.py", "test_docs.py",
)  # fmt: skip
"""Files that take twenty seconds and more: begun last, one would keep its process busy when all others have finished."""
LIVE = "node"
"""Folder of tests that wait more than they work: side by side they would leave processors idle, and one another too late."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files first, live tests evenly between all others."""
    files = list(dict.fromkeys(item.path for item in items))
    live = [file for file in files if file.parent.name == LIVE]
    others = [file for file in files if file.parent.name != LIVE]
    others.sort(key=lambda file: LONGEST.index(file.name) if file.name in LONGEST else len(LONGEST))
    place = {file: (number + 0.5) / len(group) for group in (live, others) for number, file in enumerate(group)}
    items.sort(key=lambda item: place[item.path])


def pytest_collection_finish() -> None:
    """What imports have made lives to the end: the collector need not go through it a fifth of a second long, again and again."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="module", autouse=True)
def catalogue_of_the_package() -> Iterator[None]:
    """Physics that a file of tests adds is gone after it."""
    with put_back():
        yield
