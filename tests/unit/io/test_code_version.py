"""A version of the code that prose and places do not move, and that every number does."""

from __future__ import annotations

import importlib.metadata
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import pipeline
from pipeline.execution.caches.versions import RUN, SURVEY, WORK
from pipeline.io.storage import code_version
from pipeline.io.storage.code_version import DISTRIBUTIONS, Code, installed, own_code
from pipeline.io.storage.syntax import syntax_of

MOTOR = '''"""A motor."""
from __future__ import annotations

import math

from plant.physics import copper
from plant.physics.iron import loss as iron_loss
from plant.registry import shapes

POLES = 7
"""Pairs of poles."""


def torque(i: float) -> float:
    """Torque of a current."""
    if i < 0.0:
        from plant.back import torque_back

        return torque_back(i)
    # what is left of it
    return math.pi * POLES * i - iron_loss(i) - copper.loss(i) + shapes()
'''
FILES = {
    "__init__.py": '"""The package."""\n\n__version__ = "1"\n',
    "motor.py": MOTOR,
    "back.py": '"""Backwards."""\n\n\ndef torque_back(i):\n    return -2.0 * i\n',
    "unused.py": "NUMBER = 1\n",
    "physics/__init__.py": '"""Laws."""\n',
    "physics/copper.py": "from .iron import K\n\n\ndef loss(i):\n    return 0.5 * K * i\n",
    "physics/iron.py": "K = 3.0\n\n\ndef loss(i):\n    return 0.25 * i\n",
    "registry.py": (
        "from importlib import import_module\n\n\n"
        'def shapes():\n    return len(import_module("plant.rooms").__path__)\n\n\n'
        'PAGES = "pages"\n'
    ),
    "rooms/__init__.py": "",
    "rooms/cube.py": "SIDES = 6\n",
    "rooms/ball.py": "from plant.physics.iron import K\n\nSIDES = K\n",
    "pages/one.html": "<p>one</p>\n",
    "loose/two.html": "<p>two</p>\n",
}


class Plant:
    """A small package on the disk."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "plant"
        for name, text in FILES.items():
            self.write(name, text)

    def write(self, name: str, text: str) -> None:
        (self.root / name).parent.mkdir(parents=True, exist_ok=True)
        (self.root / name).write_text(text)

    def edit(self, name: str, old: str, new: str) -> None:
        text = (self.root / name).read_text()
        assert old in text
        self.write(name, text.replace(old, new))

    def move(self, name: str, to: str) -> None:
        (self.root / to).parent.mkdir(parents=True, exist_ok=True)
        (self.root / name).rename(self.root / to)

    def digest(self) -> str:
        return Code(self.root).digest("plant.motor")


@pytest.fixture
def plant(tmp_path: Path) -> Plant:
    return Plant(tmp_path)


def prose(plant: Plant) -> None:
    plant.edit("motor.py", '"""A motor."""', '"""An engine,\n\nas others say."""')
    plant.edit("motor.py", '    """Torque of a current."""\n', "")
    plant.edit("motor.py", '"""Pairs of poles."""\n', "")


def comments(plant: Plant) -> None:
    plant.edit("motor.py", "# what is left of it", "# the rest")
    plant.edit("physics/iron.py", "K = 3.0", "K = 3.0  # by measurement")


def layout(plant: Plant) -> None:
    plant.edit("back.py", "return -2.0 * i", "return (\n        -2.0\n        * i\n    )")
    plant.edit("physics/iron.py", "K = 3.0", "K = 3.00")


def order_of_imports(plant: Plant) -> None:
    one = "from plant.physics import copper\n"
    plant.edit("motor.py", one, "")
    plant.edit("motor.py", "import shapes\n", f"import shapes\n{one}")


def moved(plant: Plant) -> None:
    plant.move("back.py", "physics/deep/reverse.py")
    plant.write("physics/deep/__init__.py", '"""Deep."""\n')
    plant.edit("motor.py", "from plant.back", "from plant.physics.deep.reverse")


def package_moved(plant: Plant) -> None:
    for name in ("__init__", "copper", "iron"):
        plant.move(f"physics/{name}.py", f"laws/{name}.py")
    for name in ("motor.py", "rooms/ball.py"):
        plant.edit(name, "plant.physics", "plant.laws")


def room_moved(plant: Plant) -> None:
    for name in ("__init__", "cube", "ball"):
        plant.move(f"rooms/{name}.py", f"halls/{name}.py")
    plant.edit("registry.py", "plant.rooms", "plant.halls")


def for_checkers(plant: Plant) -> None:
    only = "if TYPE_CHECKING:\n    from plant.unused import NUMBER\n"
    plant.edit("back.py", "def torque", f"{only}\n\ndef torque")


def plug_in_renamed(plant: Plant) -> None:
    plant.move("rooms/cube.py", "rooms/die.py")


def not_imported(plant: Plant) -> None:
    plant.edit("unused.py", "1", "2")
    plant.write("unused_too.py", "from plant import motor\n")
    plant.edit("loose/two.html", "two", "three")
    plant.edit("__init__.py", '"1"', '"2"')


@pytest.mark.parametrize(
    "change",
    [
        prose,
        comments,
        layout,
        order_of_imports,
        moved,
        package_moved,
        plug_in_renamed,
        room_moved,
        for_checkers,
        not_imported,
    ],
)
def test_what_keeps_the_digest(plant: Plant, change: Callable[[Plant], None]) -> None:
    before = plant.digest()
    change(plant)
    assert plant.digest() == before


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("motor.py", "POLES = 7", "POLES = 8"),
        ("motor.py", "math.pi * POLES", "math.pi + POLES"),
        ("motor.py", "if i < 0.0", "if i <= 0.0"),
        ("motor.py", "import loss as iron_loss", "import K as iron_loss"),
        (
            "motor.py",
            "from plant.physics.iron import loss",
            "from plant.physics.copper import loss",
        ),
        ("motor.py", "import math", "import cmath as math"),
        (
            "motor.py",
            "from plant.physics import copper",
            "from plant.physics import iron as copper",
        ),
        ("back.py", "2.0", "2.5"),
        ("physics/copper.py", "0.5", "0.6"),
        ("physics/iron.py", "3.0", "3"),
        ("physics/__init__.py", '"""Laws."""', "CHANGED = True"),
        ("rooms/cube.py", "6", "8"),
        ("rooms/ball.py", "SIDES = K", "SIDES = -K"),
        ("pages/one.html", "one", "1"),
        ("registry.py", "plant.rooms", "plant.room"),
        ("registry.py", "plant.rooms", "plant.physics"),
    ],
)
def test_what_changes_the_digest(plant: Plant, file: str, old: str, new: str) -> None:
    before = plant.digest()
    plant.edit(file, old, new)
    assert plant.digest() != before


def test_a_plug_in_more_changes_the_digest(plant: Plant) -> None:
    before = plant.digest()
    plant.write("rooms/cone.py", "SIDES = 2\n")
    assert plant.digest() != before


def test_names_that_come_from_each_others_modules_are_another_digest(plant: Plant) -> None:
    """Two modules of one text that import different ones: who uses which counts."""
    plant.write("one.py", "from plant.physics.iron import loss as f\n")
    plant.write("two.py", "from plant.physics.copper import loss as f\n")
    plant.write("motor.py", "from plant.one import f as a\nfrom plant.two import f as b\n")
    before = plant.digest()
    plant.write("motor.py", "from plant.two import f as a\nfrom plant.one import f as b\n")
    assert plant.digest() != before


def test_a_circle_of_imports_has_a_digest_that_sees_all_of_it(plant: Plant) -> None:
    plant.edit("back.py", '"""Backwards."""', "from plant.motor import POLES")
    before = plant.digest()
    assert Code(plant.root).digest("plant.motor") == before
    plant.edit("back.py", "2.0", "2.5")
    assert plant.digest() != before
    with pytest.raises(LookupError, match=r"no module plant\.nothing"):
        Code(plant.root).digest("plant.nothing")


def test_what_sources_say_is_kept_and_nothing_else_is_believed(
    plant: Plant, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    notes, parsed = tmp_path / "notes" / "kept.json", []
    parse = code_version.syntax_of

    def counted(content: bytes, package: str) -> object:
        parsed.append(content)
        return parse(content, package)

    monkeypatch.setattr(code_version, "syntax_of", counted)
    expected = Code(plant.root, notes).digest("plant.motor")
    assert len(parsed) == 9
    parsed.clear()
    assert Code(plant.root, notes).digest("plant.motor") == expected
    assert parsed == []
    plant.edit("back.py", "2.0", "2.5")
    other = Code(plant.root, notes).digest("plant.motor")
    assert (len(parsed), other != expected) == (1, True)
    for noise in (b"", b"{}", notes.read_bytes().replace(b"false", b"true ")):
        notes.write_bytes(noise)
        assert Code(plant.root, notes).digest("plant.motor") == other
    (tmp_path / "file").write_text("in the way")
    assert Code(plant.root, tmp_path / "file" / "kept.json").digest("plant.motor") == other


def test_every_python_gives_the_same_digest() -> None:
    """Of a source that holds most of what the language has."""
    root = Path(pipeline.__file__).parent
    sources = [
        root / "records" / "capture.py",
        root / "io" / "storage" / "code_version.py",
        Path(__file__),
    ]
    code = (
        "import sys; from pathlib import Path\n"
        "sys.path.insert(0, sys.argv[1]); from syntax import syntax_of\n"
        "for name in sys.argv[2:]: print(syntax_of(Path(name).read_bytes(), 'pipeline').digest)"
    )
    ours = [syntax_of(source.read_bytes(), "pipeline").digest for source in sources]
    others = {shutil.which(f"python3.{n}") for n in (11, 12, 13)} - {None}
    asked = 0
    for python in sorted(map(str, others)):
        words = [python, "-c", code, str(root / "io" / "storage"), *map(str, sources)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            assert done.stdout.split() == ours, python
            asked += 1
    if not asked:
        pytest.skip("no other Python is on the path")


def test_datasheets_hang_on_every_plug_in_and_on_nothing_that_shows_them() -> None:
    closure = own_code().closure(WORK)
    root = Path(pipeline.__file__).parent
    for package in ("estimation/estimators", "contracts/gates", "crosscheck/rules", "io/readers"):
        home = f"pipeline.{package.replace('/', '.')}"
        plug_ins = {f"{home}.{p.stem}" for p in (root / package).glob("*.py")} - {
            f"{home}.__init__"
        }
        assert plug_ins and plug_ins <= closure
    packages = {module.split(".")[1] for module in closure}
    assert {"records", "physics", "numerics"} <= packages
    assert not packages & {
        "report",
        "views",
        "lots",
        "export",
        "simulator",
        "cli",
        "settings",
    }
    assert not any("io.registry" in m or "recordings" in m or m == RUN for m in closure)
    assert closure < own_code().closure(RUN)
    assert own_code().closure(SURVEY) < own_code().closure(RUN)
    assert any(module.startswith("pipeline.report") for module in own_code().closure(RUN))


def test_of_the_package_what_a_datasheet_hangs_on_changes_its_version(tmp_path: Path) -> None:
    """An equation, a page, a template, an effect, and a word more everywhere."""
    root = tmp_path / "pipeline"
    shutil.copytree(Path(pipeline.__file__).parent, root, ignore=shutil.ignore_patterns("__pyc*"))
    notes = tmp_path / "kept.json"

    def versions() -> tuple[str, str]:
        code = Code(root, notes)
        return code.digest(WORK), code.digest(RUN)

    def edit(file: str, old: str, new: str) -> None:
        text = (root / file).read_text()
        assert old in text, file
        (root / file).write_text(text.replace(old, new, 1))

    work, everything = versions()
    assert work == own_code().digest(WORK), "the same wherever the package lies"
    for file in ("numerics/least_squares.py", "estimation/formulas.py", "records/estimate.py"):
        (root / file).write_text(f"# a word\n{(root / file).read_text()}")
    assert versions() == (work, everything)
    edit("simulator/plant.py", "\n\n", "\n\nMORE = 1\n")
    edit("lots/capability.py", "\n\n", "\n\nMORE = 1\n")
    assert versions() == (work, everything), "a run simulates nothing and judges no lot"
    edit("report/pages/templates/style.css", "{", "{ ")
    assert versions()[0] == work
    assert versions()[1] != everything
    everything = versions()[1]
    edit("report/charts/axis.py", "\n\n\n", "\n\nMORE = 1\n\n\n")
    assert (versions()[0] == work, versions()[1] == everything) == (True, False)
    edit("records/estimate.py", "MOST = 1e150", "MOST = 1e151")
    assert versions()[0] != work


@pytest.mark.parametrize("module", [WORK, RUN, SURVEY])
def test_every_library_that_is_imported_changes_the_version(
    module: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = own_code().libraries(module)
    assert {"numpy", "polars"} <= set(names)
    there = installed()
    said = code_version.libraries_version.__wrapped__(module)
    assert f"python {sys.version.split()[0]}" in said
    for name in names:
        own = code_version._plain(DISTRIBUTIONS.get(name, name))
        assert own in there, f"{name}: its distribution has another name; say it in DISTRIBUTIONS"
        assert importlib.metadata.version(own) == there[own]
        monkeypatch.setattr(code_version, "installed", lambda own=own: {**there, own: "0.0"})
        assert code_version.libraries_version.__wrapped__(module) != said, name
        monkeypatch.setattr(
            code_version, "installed", lambda own=own: {k: v for k, v in there.items() if k != own}
        )
        assert f"{own} -" in code_version.libraries_version.__wrapped__(module)
