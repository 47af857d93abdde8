"""The sources of the site: the Markdown files of the repository, and pages that the code writes."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pipeline
from pipeline.criticism.effect import Effect
from pipeline.criticism.library.registry import effects
from tests.site.gallery import signature, simulated

TOP = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
"""Files at the top of the repository, and the pages that they become."""
GROUPS: Mapping[str, Sequence[str]] = {
    "Tutorials": ("notebooks/*", "tutorial-effect"),
    "How to": (
        "source-maps",
        "drive-logs",
        "recorder-forms",
        "review",
        "registry",
        "export",
        "lots",
        "fleet",
        "watch",
    ),
    "Explanation": ("architecture", "criticism", "uncertainty", "simulator", "real-recordings"),
    "Reference": ("api", "glossary", "source-map-keys", "policy", "gallery"),
    "Project": ("contributing", "changelog", "decisions/index"),
}
"""The pages of the side bar; those that are in no group are under `REST`."""
REST = "Measured"


def stage(root: Path, folder: Path) -> None:
    """Writes every source of the site into a folder."""
    shutil.copytree(root / "docs", folder, dirs_exist_ok=True)
    for name, page in TOP.items():
        (folder / page).write_text(_relinked((root / name).read_text(encoding="utf-8")), "utf-8")
    licence = (root / "LICENSE").read_text(encoding="utf-8")
    (folder / "license.md").write_text(
        f"---\norphan: true\n---\n# License\n\n```text\n{licence}```\n"
    )
    for page in folder.rglob("*.md"):
        page.write_text(_from_docs(page.read_text(encoding="utf-8")), encoding="utf-8")
    for path in sorted((folder / "notebooks").glob("*.ipynb")):
        path.with_suffix(".md").write_text(notebook_page(json.loads(path.read_bytes())), "utf-8")
        path.unlink()
    (folder / "api.md").write_text(api_page(), encoding="utf-8")
    (folder / "gallery.md").write_text(gallery_page(folder / "images"), encoding="utf-8")
    _decisions(folder / "decisions")
    with (folder / "index.md").open("a", encoding="utf-8") as index:
        index.write(_contents(folder))


def _relinked(text: str) -> str:
    """A page of the top folder with its links as seen from the folder of the site."""
    text = re.sub(r"\]\(docs/([^)]*)\)", r"](\1)", text)
    for name, page in TOP.items():
        text = text.replace(f"]({name}", f"]({page}")
    return text.replace("](LICENSE)", "](license.md)")


def _from_docs(text: str) -> str:
    """A page of docs/ with its links to pages of the top folder, and to notebooks."""
    for name, page in TOP.items():
        text = text.replace(f"](../{name}", f"]({page}")
    return re.sub(r"\]\((notebooks/[^)]*)\.ipynb\)", r"](\1.md)", text)


def _contents(folder: Path) -> str:
    """The side bar: one hidden table of contents a group."""
    groups = {
        title: [path for name in names for path in sorted(folder.glob(f"{name}.md"))]
        for title, names in GROUPS.items()
    }
    named = {path for pages in groups.values() for path in pages}
    top = {folder / page for page in ("index.md", "license.md")}
    groups[REST] = sorted({*folder.glob("*.md")} - named - top)
    parts = []
    for title, pages in groups.items():
        names = "\n".join(p.relative_to(folder).with_suffix("").as_posix() for p in pages)
        parts.append(f"\n```{{toctree}}\n:hidden:\n:caption: {title}\n\n{names}\n```\n")
    return "".join(parts)


def _decisions(folder: Path) -> None:
    """The list of the decisions, newest last."""
    pages = sorted(folder.glob("[0-9]*.md"))
    names = "\n".join(page.stem for page in pages)
    (folder / "index.md").write_text(
        "# Decisions\n\nEach page states the context, what was tried with figures, and the "
        f"decision.\n\n```{{toctree}}\n:maxdepth: 1\n\n{names}\n```\n",
        encoding="utf-8",
    )


def api_page() -> str:
    """Every public function and its result, from their docstrings."""
    functions = [n for n in pipeline.__all__ if not isinstance(getattr(pipeline, n), type)]
    records = [n for n in pipeline.__all__ if isinstance(getattr(pipeline, n), type)]
    lines = ["# Python API", "", "`import pipeline` offers these names and no others.", ""]
    lines += ["## Functions", ""]
    for name in functions:
        lines += _directive("autofunction", name)
    lines += ["## Results", ""]
    for name in records:
        lines += _directive("autoclass", name, ":members:")
    return "\n".join(lines) + "\n"


def _directive(kind: str, name: str, *options: str) -> list[str]:
    body = [f".. {kind}:: pipeline.{name}", *(f"   {option}" for option in options)]
    return [f"### {name}", "", "```{eval-rst}", *body, "```", ""]


def gallery_page(images: Path) -> str:
    """Every effect with its equation, its signature as drawn, and the tests that show it."""
    images.mkdir(parents=True, exist_ok=True)
    lines = [
        "# Gallery of effects",
        "",
        "Each picture shows what an effect of typical size adds to a noise-free recording of the",
        "simulator, on a motor without any other effect. The simulator shares no code with the",
        "models. The column is the one whose change is large and best explained by one variable.",
        "",
    ]
    for effect in all_effects():
        tests = ", ".join(f"`{test}`" for test in effect.tests)
        lines += [f"## {effect.name}", ""]
        lines += [f"{_sentence(effect.words)} {_sentence(effect.signature)}", ""]
        lines += _picture(effect, images)
        lines += [f"- Tests that show it: {tests}. Experiment: {effect.experiment}."]
        lines += [f"- Reference: {effect.reference}", ""]
    return "\n".join(lines)


def _picture(effect: Effect, images: Path) -> list[str]:
    """The picture of a signature with its caption; a sentence where the simulator has no effect."""
    if not simulated(effect):
        return ["The simulator does not have this effect, so there is no picture.", ""]
    found = signature(effect)
    found.figure(effect.name).save(images / f"effect-{effect.name}.svg")
    picture = f"![Change of {found.column} in {found.capture}](images/effect-{effect.name}.svg)"
    caption = f"Change of `{found.column}` in `{found.capture}`, against `{found.cause}`."
    return [picture, "", caption, ""]


def all_effects() -> list[Effect]:
    """Every effect by name."""
    found = effects()
    return list(found.values() if isinstance(found, Mapping) else found)


def _sentence(text: str) -> str:
    text = text.replace("*", r"\*").replace("_", r"\_")
    first = text if text[1:2] in "_\\" else text[:1].upper() + text[1:]
    return f"{first}."


def notebook_page(notebook: Mapping[str, Any]) -> str:
    """A notebook as Markdown, with the outputs that are kept in it."""
    parts = []
    for cell in notebook["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        parts += [_output(output) for output in cell["outputs"]]
    return "\n\n".join(parts) + "\n"


def _output(output: Mapping[str, Any]) -> str:
    data = output.get("data", {})
    if "text/html" in data:
        return "```{raw} html\n" + "".join(data["text/html"]) + "\n```"
    text = "".join(output.get("text", data.get("text/plain", "")))
    return f"```text\n{text}\n```"
