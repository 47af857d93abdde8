"""One thread and one seed for every test: a result must not depend on cores, clock or history."""

from __future__ import annotations

import os

import hypothesis

from pipeline.__main__ import THREADS

for name in THREADS:  # before anything imports numpy
    os.environ.setdefault(name, "1")

hypothesis.settings.register_profile(
    "house", deadline=None, derandomize=True, database=None, print_blob=True
)
hypothesis.settings.load_profile("house")
