"""Builds the documentation site: `python -m tests.site [FOLDER]`; any warning is an error."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.site.links import broken_in_site
from tests.site.pages import stage

ROOT = Path(__file__).parents[2]


def main(folder: Path) -> int:
    """Stages the pages, runs Sphinx on them and checks every link; 0 where nothing is wrong."""
    from sphinx.cmd.build import build_main

    with TemporaryDirectory() as sources:
        stage(ROOT, Path(sources))
        shutil.rmtree(folder, ignore_errors=True)
        strict = ["--fail-on-warning", "--keep-going", "--quiet"]
        code = build_main(["-b", "html", *strict, sources, str(folder)])
    shutil.rmtree(folder / ".doctrees", ignore_errors=True)
    faults = broken_in_site(folder)
    sys.stderr.write("".join(f"broken link: {fault}\n" for fault in faults))
    sys.stdout.write(f"{folder / 'index.html'}\n")
    return code or int(bool(faults))


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if sys.argv[1:] else "reports/site")))
