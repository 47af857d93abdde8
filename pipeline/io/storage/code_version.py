"""What code made a result, without asking git: a release wheel has no history.

A module's digest is made of what its source says (`syntax`) and of the digests of the modules of
the package that it imports, by the names that it takes from them. So comments, docstrings, layout,
the order of imports and the places of files change nothing, and code that is not imported counts as
little. A package that a module is in counts where it holds code. A text that is the name of a
module counts as its import; one that is the name of a package, whose plug-ins are found by it, as
the import of all its modules; one that is the name of a folder of data beside the module counts
every file in that. What is only for type checkers counts not at all.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import astuple
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import pipeline
from pipeline.io.storage import syntax
from pipeline.io.storage.checksummed import keep_checksummed, read_checksummed
from pipeline.io.storage.identity import notes_folder
from pipeline.io.storage.syntax import BY_TEXT, Import, Syntax, syntax_of
from pipeline.plugins import outside_version

DISTRIBUTIONS: Mapping[str, str] = {
    "google": "protobuf",
    "hydra": "hydra-core",
    "rerun": "rerun-sdk",
    "rerun_bindings": "rerun-sdk",
    "yaml": "PyYAML",
}
"""Distributions that bear another name than what is imported of them."""
OPTIONAL = ("asammdf", "h5py", "nptdms")
"""Libraries that readers import by name, where they are installed."""
EMPTY = syntax_of(b"", "").digest
MOST_KEPT = 5000


class Code:
    """The sources of one package.

    Parameters
    ----------
    root
        Folder of the package.
    notes
        File that keeps what sources hold, so that the next start need not parse them.

    """

    def __init__(self, root: Path, notes: Path | None = None) -> None:
        self.root = root
        self._notes = notes
        self._digests: dict[str, str] = {}
        self._sources: dict[Path, tuple[bytes, Syntax]] = {}
        self._kept = _kept(notes)
        self._new: dict[str, Any] = {}

    def digest(self, *modules: str) -> str:
        """sha256 of what some modules compute.

        Parameters
        ----------
        *modules
            Dotted names.

        Returns
        -------
        str
            Of syntax trees without docstrings and comments, independent of where a file lies.

        """
        digests = [self._digest(module) for module in modules]
        self._keep()
        return _sha256(digests)

    def closure(self, *modules: str) -> frozenset[str]:
        """Modules, and all of the package that they import, directly or not.

        Parameters
        ----------
        *modules
            Dotted names.

        """
        queue, modules_used = list(modules), set[str]()
        while queue:
            module = queue.pop()
            if module not in modules_used:
                modules_used.add(module)
                queue += [target for _, _, target in self._targets(module)]
                queue += [*self._found_by(module), *self._above(module)]
        return frozenset(modules_used)

    def libraries(self, *modules: str) -> tuple[str, ...]:
        """Top names of what is imported, directly or not, of packages other than Python's own.

        Parameters
        ----------
        *modules
            Dotted names.

        """
        libraries = (self._source(module)[1].libraries for module in self.closure(*modules))
        return tuple(sorted({name for names in libraries for name in names}))

    def _digest(self, module: str) -> str:
        known = self._digests.get(module)
        if known is not None:
            return known
        content, syntax_of_module = self._source(module)
        # stands in where a circle of imports comes back to it
        self._digests[module] = syntax_of_module.digest
        digests = {
            (bound, name, self._digest(target)) for bound, name, target in self._targets(module)
        }
        plug_ins = {self._digest(plug_in) for plug_in in self._found_by(module)}
        above = {self._digest(package) for package in self._above(module)}
        digest = _sha256(
            [
                syntax_of_module.digest,
                sorted(digests),
                sorted(plug_ins),
                sorted(above),
                self._texts(module),
                self._data(module, content),
            ]
        )
        self._digests[module] = digest
        return digest

    def _targets(self, module: str) -> list[tuple[str, str, str]]:
        """What a module takes of its package: bound to which name, which name of which module.

        The package itself holds public names and the release, which no result hangs on.
        """
        targets = []
        for one in self._source(module)[1].imports:
            if one.bound == BY_TEXT:
                targets.append((BY_TEXT, "", one.home))
                continue
            home = self._home(module, one)
            inner = f"{home}.{one.name}"
            if one.name and self._path(inner) is not None:
                targets.append((one.bound, "", inner))
            elif home != self.root.name:
                targets.append((one.bound, one.name, home))
        return [(b, n, target) for b, n, target in targets if self._path(target) is not None]

    def _home(self, module: str, one: Import) -> str:
        if not one.level:
            return one.home
        parts = module.split(".") if self._is_package(module) else module.split(".")[:-1]
        parts = parts[: len(parts) - one.level + 1]
        return ".".join([*parts, *filter(None, [one.home])])

    def _above(self, module: str) -> list[str]:
        """The packages that a module is in, where they hold more than a docstring."""
        parts = module.split(".")
        packages = (".".join(parts[:n]) for n in range(2, len(parts)))
        return [p for p in packages if self._source(p)[1].digest != EMPTY]

    def _texts(self, module: str) -> list[str]:
        """Texts that could name a module, but name none."""
        named = (one for one in self._source(module)[1].imports if one.bound == BY_TEXT)
        return sorted(one.home for one in named if self._path(one.home) is None)

    def _found_by(self, module: str) -> list[str]:
        """The modules of the packages that a module names in a text."""
        named = (one for one in self._source(module)[1].imports if one.bound == BY_TEXT)
        homes = sorted({f"{one.home}." for one in named if self._is_package(one.home)})
        return [
            name
            for home in homes
            for name in sorted(self._files)
            if name.startswith(home) and "." not in name.removeprefix(home)
        ]

    def _is_package(self, module: str) -> bool:
        path = self._path(module)
        return path is not None and path.name == "__init__.py"

    def _data(self, module: str, content: bytes) -> list[tuple[str, str]]:
        """Name and digest of the files in folders of data beside a module that it names."""
        home = self._files[module].parent
        named = (f for f in self._walked[1].get(home, ()) if f'"{f.name}"'.encode() in content)
        return sorted(
            (file.relative_to(home).as_posix(), hashlib.sha256(file.read_bytes()).hexdigest())
            for folder in named
            for file in folder.rglob("*")
            if file.is_file()
        )

    def _source(self, module: str) -> tuple[bytes, Syntax]:
        path = self._path(module)
        if path is None:
            raise LookupError(f"there is no module {module} in {self.root}")
        if path not in self._sources:
            content = path.read_bytes()
            self._sources[path] = content, self._syntax(content)
        return self._sources[path]

    def _syntax(self, content: bytes) -> Syntax:
        sha256 = hashlib.sha256(content).hexdigest()
        noted = self._kept.get(sha256)
        if noted is not None:
            digest, imports, libraries = noted
            return Syntax(digest, tuple(Import(*i) for i in imports), tuple(libraries))
        syntax = syntax_of(content, self.root.name)
        self._new[sha256] = astuple(syntax)
        return syntax

    def _keep(self) -> None:
        """Keeps what sources say for the next start; without a place it is found out again."""
        if self._notes is not None and self._new:
            records = [*self._kept.items(), *self._new.items()][-MOST_KEPT:]
            keep_checksummed(self._notes, {"form": _form(), "syntax": dict(records)})
        self._kept |= self._new
        self._new = {}

    def _path(self, module: str) -> Path | None:
        """The file of a module of the package; None where the name is of none."""
        return self._files.get(module)

    @property
    def _files(self) -> Mapping[str, Path]:
        """Every module of the package with its file."""
        return self._walked[0]

    @cached_property
    def _walked(self) -> tuple[Mapping[str, Path], Mapping[Path, list[Path]]]:
        """The modules with their files, and the folders without modules by the folder above."""
        modules: dict[str, Path] = {}
        data_folders: dict[Path, list[Path]] = {}
        for folder, folders, files in os.walk(self.root):
            place = Path(folder)
            folders[:] = sorted(name for name in folders if name != "__pycache__")
            home = ".".join([self.root.name, *place.relative_to(self.root).parts])
            sources = [place / name for name in files if name.endswith(".py")]
            for file in sources:
                modules[home if file.stem == "__init__" else f"{home}.{file.stem}"] = file
            if not sources:
                data_folders.setdefault(place.parent, []).append(place)
                folders.clear()
        return modules, data_folders


def _kept(notes: Path | None) -> dict[str, Any]:
    """What is known of sources by the sha256 of their bytes."""
    content = None if notes is None else read_checksummed(notes)
    if not isinstance(content, dict) or content.get("form") != _form():
        return {}
    return dict(content["syntax"])


@cache
def _form() -> str:
    """What says what sources say: this release of Python, and `syntax` as it stands."""
    content = Path(syntax.__file__).read_bytes()
    return f"{platform.python_version()} {hashlib.sha256(content).hexdigest()}"


def _sha256(parts: Any) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


@cache
def own_code() -> Code:
    """The sources of this package."""
    home = notes_folder()
    return Code(
        Path(pipeline.__file__).parent, None if home is None else home / "syntax" / "kept.json"
    )


@cache
def code_version(*modules: str) -> str:
    """The release, and a digest of what modules of the package compute: `0.1.0+1a2b3c4d5e6f`.

    Parameters
    ----------
    *modules
        Dotted names.

    """
    return f"{pipeline.__version__}+{own_code().digest(*modules)[:12]}"


@cache
def closure_digest(module: str) -> str:
    """sha256 of what a module computes, with all of the package that it imports.

    Parameters
    ----------
    module
        Dotted name. Modules of other packages have one digest for all: they count in
        `libraries_version`.

    """
    return own_code().digest(*_of_package(module))


@cache
def libraries_version(*modules: str) -> str:
    """Versions of what a result depends on beside this package.

    Parameters
    ----------
    *modules
        Dotted names.

    Returns
    -------
    str
        Python, the kind of machine, all libraries that are imported, directly or not (`-` for one
        that is not installed), and plug-ins of other packages.

    """
    names = {DISTRIBUTIONS.get(name, name) for name in own_code().libraries(*_of_package(*modules))}
    versions = _versions({*names, *OPTIONAL})
    machine = [f"python {platform.python_version()}", platform.machine()]
    return "; ".join(filter(None, [*machine, *versions, outside_version()]))


def _of_package(*modules: str) -> list[str]:
    """Those of the modules that are of this package."""
    return [module for module in modules if module.split(".")[0] == pipeline.__name__]


def _versions(names: Iterable[str]) -> list[str]:
    """`name version` of distributions, and of those that are named after them (`polars-...`)."""
    known = installed()
    versions = []
    for name in sorted({_plain(name) for name in names}):
        parts = [n for n in known if n == name or n.startswith(f"{name}-")]
        versions += [f"{n} {known[n]}" for n in sorted(parts)] if name in known else [f"{name} -"]
    return versions


def installed() -> dict[str, str]:
    """The versions of all installed distributions, by name.

    Read from the names of their folders, in a hundredth of the time that their metadata takes.
    """
    versions: dict[str, str] = {}
    for place in reversed(sys.path):
        with suppress(OSError):
            for folder in os.scandir(place or "."):
                if folder.name.endswith(".dist-info"):
                    name, _, version = folder.name.removesuffix(".dist-info").partition("-")
                    versions[_plain(name)] = version
    return versions


def _plain(name: str) -> str:
    """The normal form of a distribution's name (PEP 503)."""
    return re.sub("[-_.]+", "-", name).lower()
