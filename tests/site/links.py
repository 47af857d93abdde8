"""Checks every link of the built site, and of the Markdown files of the repository."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
FENCE = re.compile(r"^(```|~~~).*?^\1", re.MULTILINE | re.DOTALL)
HEADING = re.compile(r"^#+ +(.*)$", re.MULTILINE)


class _Page(HTMLParser):
    """The anchors and the links of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id" and value:
                self.anchors.add(value)
            elif name in ("href", "src") and value and tag != "base":
                self.links.append(value)


def broken_in_site(folder: Path) -> list[str]:
    """Links of the HTML pages of a folder to files or anchors that do not exist."""
    pages = {path: _Page(path.read_text(encoding="utf-8")) for path in folder.rglob("*.html")}
    anchors = {path: page.anchors for path, page in pages.items()}
    faults = []
    for path, page in sorted(pages.items()):
        for link in dict.fromkeys(page.links):
            fault = _fault(folder, path, link, anchors)
            if fault:
                faults.append(f"{path.relative_to(folder)}: {link}: {fault}")
    return faults


def broken_in_markdown(root: Path, paths: Iterator[Path] | list[Path]) -> list[str]:
    """Links of Markdown files to files or headings that do not exist."""
    faults = []
    for path in paths:
        text = FENCE.sub("", path.read_text(encoding="utf-8"))
        for link in dict.fromkeys(LINK.findall(text)):
            target = urlsplit(link)
            if target.scheme:
                continue
            place = (path.parent / unquote(target.path)).resolve() if target.path else path
            if not place.exists():
                faults.append(f"{path.relative_to(root)}: {link}: no such file")
            elif target.fragment and target.fragment not in headings(place):
                faults.append(f"{path.relative_to(root)}: {link}: no such heading")
    return faults


def headings(path: Path) -> set[str]:
    """The anchors of a Markdown file's headings, as Git hosts and MyST make them."""
    text = FENCE.sub("", path.read_text(encoding="utf-8"))
    return {_slug(title) for title in HEADING.findall(text)}


def _slug(title: str) -> str:
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title)
    return re.sub(r"[^\w\- ]", "", plain.lower()).strip().replace(" ", "-")


def _fault(folder: Path, page: Path, link: str, anchors: dict[Path, set[str]]) -> str:
    """Why a link is broken; empty for a good or an outside one."""
    target = urlsplit(link)
    if target.scheme or target.netloc:
        return ""
    place = (page.parent / unquote(target.path)).resolve() if target.path else page.resolve()
    if not place.is_relative_to(folder.resolve()):
        return "leaves the site"
    if not place.exists():
        return "no such file"
    known = anchors.get(folder / place.relative_to(folder.resolve()))
    if target.fragment and known is not None and unquote(target.fragment) not in known:
        return "no such anchor"
    return ""
