"""How large an effect must be to be seen at all, and which effects no captures can part.

Of each motor and capture the inner products of whitened innovations are kept: those of the base
model's nuisances and those of every effect at its size a*. What a set of captures can tell is in
their sum. a* is the size that a likelihood-ratio test of one parameter, knowing the effect and its
form, detects with power 0.9 at the 1 % level, base constants and gains being unknown:
λ = eᵀ(I − N(NᵀN + P)⁻¹Nᵀ)e.

References: [1] Kay, Fundamentals of Statistical Signal Processing II (1998), ch. 6.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.io.storage.publish import write_whole
from pipeline.simulator.design import Motor, Recording
from pipeline.simulator.effects import ALWAYS, FORMS, parameters
from tests.benchmark.bench import MOTORS, STEMS, Station, recorded, station

HERE = Path(__file__).parent
Array = NDArray[np.float64]
POWER, LEVEL = 0.9, 0.01
SEED = 20_260_501
VERSION = 2
TIE = 12.0
MOST = 10.0
LARGEST = {"saturation": 0.6, "cross_saturation": 0.3, "inductance_harmonics": 0.6}
CURVED = {
    "presliding": 1e-3,
    "compliance": 0.02,
    "backlash": 1e-3,
    "saturation": 1e-4,
    "cross_saturation": 1e-4,
}
"""Effects that do not grow in proportion, with the least size in typical ones that is resolved."""
TWO_SIGNED = (
    "voltage_scale",
    "current_scale",
    "torque_scale",
    "current_gain",
    "current_offset",
    "torque_offset",
    "angle_offset",
    "angle_eccentricity",
    "phase_imbalance",
    "cogging",
    "unbalance",
    "bemf_harmonics",
    "inductance_harmonics",
    "sample_delay",
    "copper_temperature",
    "magnet_temperature",
)
ROUNDS = 7
IDEAL_LACKS = ("coulomb_nm", "copper_1_k", "magnet_1_k")


def needed_noncentrality(power: float = POWER, level: float = LEVEL) -> float:
    """Noncentrality λ at which a χ² test of one degree of freedom has this power.

    (z_{1−level/2} + z_power)² but for the far tail, which is solved for.
    """
    from scipy.optimize import brentq
    from scipy.stats import chi2, ncx2

    limit = float(chi2.isf(level, 1))
    return float(brentq(lambda x: float(ncx2.sf(limit, 1, x)) - power, 1e-6, 1e3, xtol=1e-12))


def changed(motor: Motor, name: str, size: float) -> Motor:
    """The motor with one effect at a size; one that every motor has departs from its own value."""
    if name in ALWAYS:
        return motor.having(**{name: parameters(name, motor)["size"] + size})
    return motor.having(**{name: size})


def unchanged(motor: Motor, name: str) -> Motor:
    """What a motor with an effect is compared with: a gap needs a coupling, so it gets one."""
    return motor.having(backlash=1e-6 * typical(name, motor)) if name == "backlash" else motor


def typical(name: str, motor: Motor) -> float:
    """Size of an effect seen on real benches, in its unit."""
    return abs(parameters(name, motor)["size"])


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """What captures of one motor can tell: `gram` [stems, k, k] of nuisances, then effects.

    Effects are at `a_star`, or where no size up to `MOST` typical is seen, at typical size, and
    `a_star` is infinite. `prior` [nuisances] is the inverse variance of what is known beforehand.
    """

    motor: str
    nuisances: tuple[str, ...]
    effects: tuple[str, ...]
    a_star: Mapping[str, float]
    unit: Mapping[str, float]
    stems: tuple[str, ...]
    gram: Array
    prior: Array
    known: dict[tuple[frozenset[str], str], Array] = field(default_factory=dict, repr=False)

    def remaining(self, stems: Iterable[str] = STEMS, model: str = "standard") -> Array:
        """Inner products [effects, effects] left when a model is fitted to these captures.

        `standard` has temperatures and Coulomb friction, so their sizes are fitted as well;
        `ideal` has none of the three.
        """
        wanted = frozenset(stems)
        if (wanted, model) in self.known:
            return self.known[wanted, model]
        rows = [n for n, stem in enumerate(self.stems) if stem in wanted]
        total = self.gram[rows].sum(axis=0)
        k = len(self.nuisances)
        ideal = model == "ideal"
        fitted = [n for n, key in enumerate(self.nuisances) if not (ideal and key in IDEAL_LACKS)]
        prior = np.concatenate([self.prior, np.zeros(len(self.effects))])
        if not ideal:
            fitted += [k + self.effects.index(name) for name in ALWAYS]
        normal = total[np.ix_(fitted, fitted)] + np.diag(prior[fitted])
        left: Array = total[k:, k:] - _explained(normal, total[fitted, k:])
        self.known[wanted, model] = left
        return left

    def noncentrality(
        self, name: str, size: float, stems: Iterable[str] = STEMS, model: str = "standard"
    ) -> float:
        """λ of the test that knows the effect, at a size, from some captures."""
        n = self.effects.index(name)
        scale = size / self.unit[name]
        return max(0.0, float(self.remaining(stems, model)[n, n])) * scale**2

    def rivals(
        self, name: str, size: float, stems: Iterable[str] = STEMS, model: str = "standard"
    ) -> tuple[str, ...]:
        """Effects that explain this one so well that what is left is below `TIE` in χ²."""
        left = self.remaining(stems, model)
        n, scale = self.effects.index(name), size / self.unit[name]
        whole = float(left[n, n]) * scale**2
        found = []
        for m, other in enumerate(self.effects):
            if m == n or left[m, m] <= 0.0 or (model == "standard" and other in ALWAYS):
                continue
            rival = float(left[n, m]) / float(left[m, m]) * scale * self.unit[other]
            if not self._plausible(other, rival):
                continue
            share = float(left[n, m]) ** 2 / (float(left[n, n]) * float(left[m, m]) + 1e-300)
            if whole * (1.0 - share) < TIE and whole * share > 1.0:
                found.append(other)
        return tuple(found)

    def _plausible(self, name: str, size: float) -> bool:
        """Whether an effect can have this size: its sign, and no more than `MOST` typical."""
        whole = typical(name, station(self.motor).motor)
        most = min(MOST * whole, LARGEST.get(name, math.inf))
        return abs(size) <= most and (size > 0.0 or name in TWO_SIGNED)


def _explained(normal: Array, cross: Array) -> Array:
    """crossᵀ normal⁻¹ cross [k, k], directions without information left out."""
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    power, axes = np.linalg.eigh(normal / np.outer(size, size))
    good = power > 1e-11 * power[-1]
    turned = (axes[:, good].T @ (cross / size[:, None])) / np.sqrt(power[good])[:, None]
    whole: Array = turned.T @ turned
    return whole


def measure(name: str) -> Sensitivity:
    """The sensitivity of one motor's programme, from noise-free recordings; a minute of work."""
    from tests.benchmark.innovation import base_of, nuisances, priors

    place = station(name)
    plain = _quiet(place, place.motor)
    base = base_of(place.motor)
    hindrances = [nuisances(r, place.motor, place.bench) for r in plain]
    known = tuple(hindrances[0])
    prior = np.array([1.0 if key in priors(place.bench) else 0.0 for key in known])
    fixed = [np.stack([columns[key] for key in known], axis=1) for columns in hindrances]
    column = _Columns(place, base)
    usual = {effect: column.of(effect, typical(effect, place.motor)) for effect in ALWAYS}
    bare = [n for n, key in enumerate(known) if key not in IDEAL_LACKS]
    ideal = [first[:, bare] for first in fixed]
    standard = [
        np.column_stack([first, *(_fit(parts[n], first.shape[0]) for parts in usual.values())])
        for n, first in enumerate(fixed)
    ]
    whole = np.concatenate([prior, np.zeros(len(ALWAYS))])
    a_star, unit, columns = {}, {}, []
    for effect in FORMS:
        around = (ideal, prior[bare]) if effect in ALWAYS else (standard, whole)
        a_star[effect], unit[effect], parts = _sized(effect, column, *around)
        columns.append(parts)
    gram = []
    for n, first in enumerate(fixed):
        both = np.column_stack([first, *(_fit(parts[n], first.shape[0]) for parts in columns)])
        gram.append(both.T @ both)
    return Sensitivity(name, known, tuple(FORMS), a_star, unit, STEMS, np.array(gram), prior)


def _quiet(place: Station, motor: Motor) -> list[Recording]:
    return recorded(motor, place.quiet, place.plan, SEED)


def _fit(part: Array, rows: int) -> Array:
    """A column cut or filled with zeros to the base recording's length."""
    out = np.zeros(rows)
    n = min(rows, part.size)
    out[:n] = part[:n]
    return out


@dataclass(frozen=True, slots=True)
class _Columns:
    place: Station
    base: Any

    def of(self, effect: str, size: float) -> list[Array]:
        """Innovation [m] of each capture that an effect of this size adds.

        Of an effect of both signs half of what lies between them: gains of a few percent tie to
        first order, and the square of their size would seem to part them.
        """
        there = self._added(effect, size, unchanged(self.place.motor, effect))
        if effect not in TWO_SIGNED or effect in CURVED:
            return there
        back = self._added(effect, -size, unchanged(self.place.motor, effect))
        return [0.5 * (one - _fit(two, one.size)) for one, two in zip(there, back, strict=True)]

    def _added(self, effect: str, size: float, plain: Motor) -> list[Array]:
        from tests.benchmark.innovation import innovations

        with_it = _quiet(self.place, changed(self.place.motor, effect, size))
        without = _quiet(self.place, plain)
        parts = []
        for one, two in zip(with_it, without, strict=True):
            first = next(iter(two.tables[0]))
            rows = min(one.tables[0][first].size, two.tables[0][first].size)
            new, old = (
                innovations(r, self.place.motor, self.place.bench, self.base, rows)
                for r in (one, two)
            )
            parts.append(new - old)
        return parts


def noncentrality_of(parts: Iterable[Array], fixed: Iterable[Array], prior: Array) -> float:
    """λ of columns [m each] with the nuisances' [m, k each] projected out; `prior` [k]."""
    own, normal, cross = 0.0, np.diag(prior).astype(np.float64), np.zeros(prior.size)
    for part, first in zip(parts, fixed, strict=True):
        column = _fit(part, first.shape[0])
        own += float(column @ column)
        normal += first.T @ first
        cross += first.T @ column
    return max(0.0, own - float(_explained(normal, cross[:, None])[0, 0]))


def _sized(
    effect: str, column: _Columns, fixed: list[Array], prior: Array
) -> tuple[float, float, list[Array]]:
    """a*, the size that `columns` are of, and the columns; curved effects are sized near a*."""
    motor, need = column.place.motor, needed_noncentrality()
    whole = typical(effect, motor)
    most = min(MOST * whole, LARGEST.get(effect, math.inf))
    least = CURVED.get(effect, 0.0) * whole
    if effect not in CURVED:
        parts = column.of(effect, whole)
        size = whole * math.sqrt(need / max(noncentrality_of(parts, fixed, prior), 1e-30))
        if size > most:
            return math.inf, whole, parts
        return size, size, [part * (size / whole) for part in parts]
    low, high = least, most
    size, guess = least, least
    for _ in range(ROUNDS):
        parts = column.of(effect, size)
        seen = noncentrality_of(parts, fixed, prior)
        guess = size * math.sqrt(need / max(seen, 1e-30))
        if abs(guess / size - 1.0) < 0.02 or (size == least and seen > need):
            return size, size, parts
        if size == most and seen < need:
            return math.inf, size, parts
        low, high = (low, size) if seen > need else (size, high)
        size = guess if low < guess < high else (most if guess >= most else math.sqrt(low * high))
    return size, size, column.of(effect, size)


def digest(name: str) -> str:
    """Of everything a motor's sensitivity hangs on but the code of the simulator."""
    place = station(name)
    forms = {effect: parameters(effect, place.motor) for effect in FORMS}
    document = [
        VERSION,
        SEED,
        repr(place.motor),
        asdict(place.bench),
        [[stem, test, dict(how)] for stem, test, how in place.plan],
        {key: {k: repr(v) for k, v in value.items()} for key, value in forms.items()},
    ]
    return hashlib.sha256(json.dumps(document, sort_keys=True, default=list).encode()).hexdigest()


def saved(found: Sensitivity) -> bytes:
    """A sensitivity as an npz file, the upper triangles of its products in double precision."""
    upper = np.triu_indices(found.gram.shape[1])
    facts = {
        "digest": digest(found.motor),
        "motor": found.motor,
        "nuisances": list(found.nuisances),
        "effects": list(found.effects),
        "stems": list(found.stems),
        "a_star": {k: None if math.isinf(v) else v for k, v in found.a_star.items()},
        "unit": dict(found.unit),
        "prior": found.prior.tolist(),
    }
    stream = io.BytesIO()
    text = np.frombuffer(json.dumps(facts, sort_keys=True).encode(), dtype=np.uint8)
    np.savez_compressed(stream, facts=text, gram=found.gram[:, upper[0], upper[1]])
    return stream.getvalue()


def loaded(content: bytes) -> tuple[str, Sensitivity]:
    """The digest and the sensitivity of what `saved` wrote."""
    with np.load(io.BytesIO(content)) as box:
        facts, flat = json.loads(bytes(box["facts"])), box["gram"]
    k = len(facts["nuisances"]) + len(facts["effects"])
    upper = np.triu_indices(k)
    gram = np.zeros((flat.shape[0], k, k))
    gram[:, upper[0], upper[1]] = flat
    gram[:, upper[1], upper[0]] = flat
    a_star = {key: math.inf if v is None else v for key, v in facts["a_star"].items()}
    return facts["digest"], Sensitivity(
        facts["motor"],
        tuple(facts["nuisances"]),
        tuple(facts["effects"]),
        a_star,
        facts["unit"],
        tuple(facts["stems"]),
        gram,
        np.array(facts["prior"]),
    )


@cache
def sensitivity(name: str, folder: Path) -> Sensitivity:
    """Of one motor: as kept beside this file, as measured into `folder`, or measured now."""
    shipped = HERE / f"{name}.npz"
    own = folder / f"{name}.npz"
    for path in (shipped, own):
        if path.is_file():
            stamp, found = loaded(path.read_bytes())
            if stamp == digest(name):
                return found
    found = measure(name)
    write_whole(own, saved(found))
    return found


def measure_all(folder: Path) -> None:
    """Measures every motor of the benchmark anew into a folder."""
    for name in MOTORS:
        write_whole(folder / f"{name}.npz", saved(measure(name)))
