# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the site does to a page: tables that the code knows are put in, and files of the repository that it shows come along."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

from lugre_steering.reference import filled

ABOVE = re.compile(r"\]\(\.\./([^)#]+)\)")
"""A link from a page to a file beside ``docs/``: the site has a copy under the same path."""


def on_files(files: Files, config: Any) -> Files:
    docs = Path(config["docs_dir"])
    shown = {name for page in docs.glob("*.md") for name in ABOVE.findall(page.read_text(encoding="utf-8"))}
    for name in sorted(shown):
        files.append(File.generated(config, name, abs_src_path=str(docs.parent / name)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    return filled(ABOVE.sub(r"](\1)", markdown))
