"""Which source files make a package, and which tests are its own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Package:
    """Globs of source files, and its tests but for those that take longer than all others."""

    name: str
    sources: tuple[str, ...]
    tests: tuple[str, ...]
    slow: tuple[str, ...] = ()

    def files(self, root: Path) -> list[Path]:
        """Source files, sorted."""
        return sorted({path for glob in self.sources for path in root.glob(glob)})

    def test_files(self, root: Path) -> list[Path]:
        """Test files, sorted."""
        found: set[Path] = set()
        for name in self.tests:
            place = root / name
            found.update([place] if place.is_file() else place.rglob("test_*.py"))
        return sorted(found)


PACKAGES = {
    package.name: package
    for package in (
        Package(
            "physics",
            ("pipeline/physics/*.py",),
            ("tests/unit/physics", "tests/unit/test_glossary.py", "tests/unit/stages/test_calc.py"),
        ),
        Package(
            "numerics",
            ("pipeline/numerics/*.py",),
            ("tests/unit/numerics",),
            (
                "tests/unit/numerics/test_weak_rows.py"
                "::test_smooth_speed_of_a_long_record_is_that_of_a_short_one",
            ),
        ),
        Package("fit", ("pipeline/estimation/**/*.py",), ("tests/unit/estimation",)),
        Package(
            "contracts",
            ("pipeline/contracts/**/*.py",),
            (
                "tests/unit/contracts",
                "tests/contracts",
                "tests/unit/test_glossary.py",
                "tests/faults/test_coverage.py",
                "tests/faults/test_duplicates.py",
                "tests/faults/test_gaps.py",
                "tests/faults/test_phases.py",
                "tests/faults/test_several_captures.py",
                "tests/faults/test_signs.py",
                "tests/faults/test_simulated.py",
                "tests/faults/test_temperatures.py",
                "tests/faults/test_validate.py",
            ),
        ),
        Package("crosscheck", ("pipeline/crosscheck/**/*.py",), ("tests/unit/crosscheck",)),
        Package("performance", ("pipeline/performance/*.py",), ("tests/unit/performance",)),
        Package("cli", ("pipeline/cli/*.py",), ("tests/unit/cli",)),
        Package("criticism", ("pipeline/criticism/**/*.py",), ("tests/unit/criticism",)),
        Package("lots", ("pipeline/lots/*.py",), ("tests/unit/lots",)),
        Package(
            "mcap",
            ("pipeline/io/mcap/*.py",),
            (
                "tests/unit/io/test_mcap_arrangements.py",
                "tests/unit/io/test_mcap_limits.py",
                "tests/unit/io/test_cdr.py",
                "tests/unit/io/test_conformance.py",
                "tests/unit/io/test_ingest.py",
                "tests/unit/io/test_json_payload.py",
                "tests/unit/io/test_protobuf.py",
                "tests/unit/io/test_write_capture.py",
                "tests/faults/test_bad_mcap.py",
            ),
        ),
        Package(
            "io",
            (
                "pipeline/io/*.py",
                *(
                    f"pipeline/io/{part}/*.py"
                    for part in (
                        "ingest",
                        "inspection",
                        "maps",
                        "readers",
                        "recordings",
                        "registry",
                        "storage",
                        "tables",
                    )
                ),
            ),
            ("tests/unit/io",),
        ),
        Package("records", ("pipeline/records/*.py",), ("tests/unit/records",)),
        Package("export", ("pipeline/export/**/*.py",), ("tests/unit/export",)),
        Package("report", ("pipeline/report/**/*.py",), ("tests/unit/report",)),
        Package("views", ("pipeline/views/**/*.py",), ("tests/unit/views", "tests/unit/report")),
        Package("simulator", ("pipeline/simulator/*.py",), ("tests/unit/simulator",)),
        Package("api", ("pipeline/api/*.py",), ("tests/unit/api",)),
        Package("calculators", ("pipeline/calculators/*.py",), ("tests/unit/stages/test_calc.py",)),
        Package("execution", ("pipeline/execution/**/*.py",), ("tests/unit/stages",)),
        Package("stages", ("pipeline/stages/**/*.py",), ("tests/unit/stages", "tests/unit/cli")),
    )
}
