"""Charts: data lie where the axes say, residuals are what is left, nothing is lost."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.numerics.thinning import cloud_points, line_points
from pipeline.records.evidence import Evidence, Series
from pipeline.report.charts.axis import axis_for, symmetric_axis
from pipeline.report.charts.chart import chart, residual_scale
from pipeline.report.charts.strip import Dot, strip_plot
from pipeline.views.names import in_words, quantity_words

Array = NDArray[np.float64]
NONE = np.empty(0)


def one(x: Array, measured: Array, fitted: Array = NONE, **changes: object) -> Evidence:
    evidence = Evidence("e", "Title", "t_s", "ia_a", "line", (Series("", x, measured, fitted),))
    return replace(evidence, **changes)


def drawing(evidence: Evidence) -> ET.Element:
    return ET.fromstring(chart(evidence))


def points(svg: ET.Element, css: str) -> Array:
    paths = [p for p in svg.iter("path") if css in p.get("class", "").split()]
    found = [m for p in paths for m in re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", p.get("d", ""))]
    return np.array(found, dtype=float)


def data(svg: ET.Element, pixels: Array) -> tuple[Array, Array]:
    """Pixels to numbers in the shown units, by the geometry the read-out uses."""
    out = []
    for letter, column in (("x", 0), ("y", 1)):
        low, high, start, end = map(float, svg.attrib[f"data-{letter}"].split())
        out.append(low + (pixels[:, column] - start) * (high - low) / (end - start))
    return out[0], out[1]


def test_points_lie_where_the_axes_say() -> None:
    x = np.linspace(0.0, 0.01, 11)
    y = 0.2 + 30.0 * x
    svg = drawing(one(x, y))
    x_back, y_back = data(svg, points(svg, "measured"))
    assert svg.attrib["data-x-unit"] == "ms"
    assert svg.attrib["data-y-unit"] == "mA"
    np.testing.assert_allclose(x_back, 1e3 * x, atol=10 * 0.06 / 560)
    np.testing.assert_allclose(y_back, 1e3 * y, atol=330 * 0.06 / 210)


def test_tick_labels_stand_at_their_values() -> None:
    svg = drawing(one(np.linspace(-3, 3, 7), np.linspace(10, 40, 7), x_name="iq_a"))
    low, high, start, end = map(float, svg.attrib["data-x"].split())
    ticks = [t for t in svg.iter("text") if t.get("class") == "tick x"]
    assert len(ticks) >= 4
    for tick in ticks:
        value = float(tick.text.replace("−", "-"))
        place = start + (value - low) * (end - start) / (high - low)
        assert float(tick.get("x")) == pytest.approx(place, abs=0.06)


def test_residual_panel_holds_measured_less_fitted_on_a_symmetric_axis() -> None:
    x = np.linspace(0.0, 1.0, 50)
    residual = 0.3 * np.where(np.arange(50) % 2 == 0, 1.0, -0.5)
    svg = drawing(one(x, 5.0 + residual, np.full(50, 5.0)))
    places = points(svg, "residual")
    ticks = {t.text: float(t.get("y")) - 4 for t in svg.iter("text") if t.get("class") == "tick y"}
    zero = max(y for text, y in ticks.items() if float(text.replace("−", "-")) == 0.0)
    positive = next(text for text, y in ticks.items() if y < zero < y + 60 and text != "5.0")
    per_pixel = float(positive) / (zero - ticks[positive])  # mA a pixel
    np.testing.assert_allclose((zero - places[:, 1]) * per_pixel, 1e3 * residual, atol=8.0)
    assert any("measured − fitted [mA]" in (t.text or "") for t in svg.iter("text"))


def test_without_a_fit_there_is_no_residual_panel() -> None:
    svg = drawing(one(np.arange(5.0), np.arange(5.0)))
    assert points(svg, "residual").size == 0
    assert not list(svg.iter("rect"))


def test_noise_scale_is_blind_to_a_smooth_misfit() -> None:
    """White noise of known sigma plus a slow wave: rms sees both, the noise only the first."""
    rng = np.random.default_rng(11)
    x = np.linspace(0, 1, 20_000)
    noise = rng.normal(0.0, 0.5, x.size)
    white = residual_scale((Series("", x, noise, np.zeros_like(x)),))
    waved = residual_scale((Series("", x, noise + np.sin(7 * x), np.zeros_like(x)),))
    assert white is not None
    assert waved is not None
    assert white.noise == pytest.approx(0.5, rel=0.02)  # sd of the estimate is 0.6 %
    assert white.ratio == pytest.approx(1.0, abs=0.02)
    assert waved.noise == pytest.approx(white.noise, rel=1e-3)
    assert waved.rms == pytest.approx(np.sqrt(np.mean((noise + np.sin(7 * x)) ** 2)))
    assert waved.ratio > 1.4


def test_noise_scale_does_not_depend_on_the_order_of_points() -> None:
    rng = np.random.default_rng(3)
    x, y = np.arange(500.0), rng.normal(size=500)
    shuffled = rng.permutation(500)
    straight = residual_scale((Series("", x, y, np.zeros(500)),))
    mixed = residual_scale((Series("", x[shuffled], y[shuffled], np.zeros(500)),))
    assert straight == mixed


def test_thinning_keeps_every_extreme_and_every_gap() -> None:
    rng = np.random.default_rng(4)
    y = rng.normal(size=100_003)
    y[50_001], y[77] = 40.0, -40.0
    y[30_000:30_010] = np.nan
    kept = line_points(y, 600)
    assert kept.size <= 600 + 3
    assert {77, 50_001, 0, 100_002} <= set(kept.tolist())
    assert np.isnan(y[kept]).sum() == 1
    assert np.all(np.diff(kept) > 0)
    np.testing.assert_array_equal(line_points(y[:500], 600), np.arange(500))


def test_a_cloud_keeps_one_point_of_each_cell() -> None:
    x = np.array([0.1, 0.2, 5.5, np.nan, 5.6])
    assert cloud_points(x, np.array([0.1, 0.3, 1.2, 0.0, 9.9]), 1.0).tolist() == [0, 2, 4]


def test_a_gap_breaks_the_line() -> None:
    y = np.array([0.0, 1.0, np.nan, 1.0, 0.0])
    svg = drawing(one(np.arange(5.0), y))
    path = next(p for p in svg.iter("path") if "measured" in p.get("class", ""))
    assert re.sub(r"[\d. ]", "", path.get("d", "")) == "MLML"


@pytest.mark.parametrize("kind", ["line", "scatter", "bars"])
@pytest.mark.parametrize(
    "values",
    [[1.0], [2.0, 2.0, 2.0], [0.0, 0.0], [1e-12, -1e-12], [1e9, np.nan, np.inf], [-5.0, -5.0]],
)
def test_odd_data_still_make_a_drawing(kind: str, values: list[float]) -> None:
    y = np.array(values)
    svg = drawing(one(np.arange(y.size, dtype=float), y, y.copy(), kind=kind))
    assert "nan" not in ET.tostring(svg, encoding="unicode").lower()
    assert "inf" not in re.sub("label=.*?>", "", ET.tostring(svg, encoding="unicode").lower())


def test_nothing_finite_says_so() -> None:
    assert "no finite samples" in chart(one(np.array([np.nan]), np.array([1.0])))
    assert "no finite samples" in chart(one(NONE, NONE))


def test_bars_stand_on_zero_with_the_height_of_their_value() -> None:
    x, y = np.array([1.0, 2.0, 3.0]), np.array([0.5, 2.0, -1.0])
    svg = drawing(one(x, y, kind="bars", x_name="cogging_order"))
    path = next(p for p in svg.iter("path") if "bars" in p.get("class", "").split())
    boxes = re.findall(r"M([\d.]+) ([\d.]+)V([\d.]+)H([\d.]+)V", path.get("d", ""))
    assert len(boxes) == 3
    low, high, start, end = map(float, svg.attrib["data-y"].split())
    for (_, base, top, _), value in zip(boxes, y, strict=True):
        assert low + (float(base) - start) * (high - low) / (end - start) == pytest.approx(0, abs=1)
        shown = low + (float(top) - start) * (high - low) / (end - start)
        assert shown == pytest.approx(value, abs=0.01)


def test_hostile_labels_are_text() -> None:
    series = tuple(
        Series(f'<script>"{k}&', np.arange(3.0), np.arange(3.0) + k, NONE) for k in range(2)
    )
    text = chart(Evidence("e", "<b>&\"'", "t_s", "ia_a", "line", series))
    assert "<script" not in text
    assert ET.fromstring(text).attrib["aria-label"].startswith("<b>&\"'")


def test_labels_at_the_ends_do_not_overlap() -> None:
    series = tuple(
        Series(f"s{k}", np.arange(3.0), np.full(3, 1 + 1e-3 * k), NONE) for k in range(8)
    )
    svg = drawing(Evidence("e", "t", "t_s", "ia_a", "line", series))
    places = sorted(float(t.get("y")) for t in svg.iter("text") if "end" in t.get("class", ""))
    assert len(places) == 8
    assert min(np.diff(places)) >= 12.9
    assert places[-1] <= 24 + 210 + 5


@pytest.mark.parametrize(
    ("name", "low", "high", "labels", "title"),
    [
        ("t_s", 0.0, 0.008, ("0", "2", "4", "6", "8"), "time [ms]"),
        ("torque_shaft_nm", -0.02, 0.02, ("−20", "−10", "0", "10", "20"), "shaft torque [mN·m]"),
        ("theta_elec_deg", 0.0, 345.0, ("0", "90", "180", "270"), "electrical angle [°]"),
        ("temp_winding_degc", 25.0, 90.0, ("40", "60", "80"), "winding temperature [°C]"),
        ("iq_a", 7.0, 7.0, ("6.8", "7.0", "7.2"), "i_q [A]"),
        ("cogging_order", 1.0, 120.0, ("25", "50", "75", "100"), "cogging order"),
    ],
)
def test_axes_have_round_ticks_and_units(
    name: str, low: float, high: float, labels: tuple[str, ...], title: str
) -> None:
    axis = axis_for(name, low, high, 0.0, 100.0)
    assert axis.labels() == labels
    assert axis.title == title


def test_symmetric_axis_has_zero_in_its_middle() -> None:
    axis = symmetric_axis("ia_a", 0.03, 200.0, 100.0)
    assert axis.pixel(0.0) == 150.0
    assert axis.labels() == ("−20", "0", "20")
    assert symmetric_axis("ia_a", 0.0, 200.0, 100.0).low == -1.0


def test_words_of_a_quantity() -> None:
    assert quantity_words("temp_magnet_degc") == "magnet temperature"
    assert quantity_words("order") == "order"
    assert [quantity_words(n) for n in ("vab_v", "rab_ohm", "lca_h")] == ["v_ab", "R_ab", "L_ca"]
    assert quantity_words("theta_in_one_of_60_waves_rad") == "angle in one of 60 waves"
    text = "drag as a curve of omega_mech_rad_s times iq_a/(9.1 A), not of iq_abs_a"
    assert in_words(text) == "drag as a curve of shaft speed times i_q/(9.1 A), not of iq_abs_a"


def test_a_strip_draws_each_motor_at_its_value_with_its_uncertainty() -> None:
    rows = [
        ("A", [Dot("m1", "m1.html", "released", 0.30, 0.001)]),
        (
            "B",
            [Dot("m2", "m2.html", "refused", 0.32, 0.002), Dot("<m3>", "x", "released", 0.31, 0)],
        ),
    ]
    text = strip_plot("r_phase_ohm", "ohm", rows)
    svg = ET.fromstring(text)
    dots = {a.find("title").text: a for a in svg.iter("a")}
    assert set(dots) == {"m1: 300.0 ± 2.0 mΩ", "m2: 320.0 ± 4.0 mΩ", "<m3>: 310.0 mΩ"}
    places = [float(a.find("circle").get("cx")) for a in svg.iter("a")]
    assert (places[2] - places[0]) / (places[1] - places[0]) == pytest.approx(0.5, abs=0.01)
    bar = dots["m2: 320.0 ± 4.0 mΩ"].find("path").get("d")
    width = float(bar.split("h")[1])
    assert width / (places[1] - places[0]) == pytest.approx(0.008 / 0.02, abs=0.01)
    assert dots["m2: 320.0 ± 4.0 mΩ"].find("circle").get("class") == "dot refused"


def test_a_dense_trace_is_a_band_between_its_extremes_and_its_fit_two_edges() -> None:
    """A curve drawn over itself a hundred times is one block that hides what was measured."""
    x = np.linspace(0.0, 1.0, 40_000)
    wave = np.sin(2 * np.pi * 400 * x) * (1.0 + x)
    one = Evidence("e", "t", "t_s", "ia_a", "line", (Series("", x, wave, 0.9 * wave),))
    paths = {p.attrib["class"]: p.attrib["d"] for p in ET.fromstring(chart(one)).iter("path")}
    band, edges = paths["measured trace"], paths["fitted"]
    assert band.endswith("Z") and band.count("M") == 1
    assert edges.count("M") == 2 and "Z" not in edges
    places = [(float(a), float(b)) for a, b in re.findall(r"[ML]([\d.]+) ([\d.]+)", band)]
    upper, lower = places[: len(places) // 2], places[len(places) // 2 :]
    widths = [low[1] - up[1] for up, low in zip(upper, reversed(lower), strict=True)]
    assert widths[-2] == pytest.approx(2.0 * widths[1], rel=0.05), "it grows with the wave"
    assert all(up[0] == low[0] for up, low in zip(upper, reversed(lower), strict=True))


def test_a_band_ends_at_a_gap() -> None:
    x = np.linspace(0.0, 1.0, 40_000)
    wave = np.where((x > 0.4) & (x < 0.6), np.nan, np.sin(2 * np.pi * 400 * x))
    svg = chart(Evidence("e", "t", "t_s", "ia_a", "line", (Series("", x, wave, 0.9 * wave),)))
    paths = {p.attrib["class"]: p.attrib["d"] for p in ET.fromstring(svg).iter("path")}
    assert paths["measured trace"].count("Z") == 2
    assert paths["fitted"].count("M") == 4


def test_a_quiet_trace_stays_a_line() -> None:
    x = np.linspace(0.0, 1.0, 40_000)
    one = Evidence("e", "t", "t_s", "ia_a", "line", (Series("", x, x, np.empty(0)),))
    svg = chart(one)
    assert "trace" not in svg and "curve" in svg


def test_one_sample_far_out_does_not_flatten_the_residual() -> None:
    rng = np.random.default_rng(3)
    x, noise = np.linspace(0.0, 1.0, 500), rng.normal(0.0, 0.01, 500)
    noise[250] = 5.0
    one = Evidence("e", "t", "iq_a", "vd_v", "scatter", (Series("", x, noise, np.zeros(500)),))
    assert ", 1 beyond</text>" in chart(one)
    residual = re.search(r'class="residual[^"]*" data-label="" d="([^"]*)"', chart(one))
    assert residual is not None
    ys = np.array([float(y) for y in re.findall(r" ([\d.]+)h0", residual[1])])
    assert np.percentile(ys, 95) - np.percentile(ys, 5) > 15.0
    noise[::25] = 5.0
    assert "beyond" not in chart(one), "one in twenty-five is no outlier"


def test_what_an_earlier_fit_made_is_drawn_with_what_it_left() -> None:
    """The residual's axis holds both, so that the fall is seen."""
    x = np.linspace(0.0, 1.0, 201)
    measured = np.sin(6.0 * x)
    now = Series("", x, measured, measured - 0.001 * np.sin(300.0 * x), measured - 0.1)
    svg = drawing(replace(one(x, measured), series=(now,)))
    lines = {p.get("class"): p for p in svg.iter("path") if "before" in p.get("class", "").split()}
    assert set(lines) == {"before", "residual before curve"}
    below = points(svg, "residual")
    assert np.ptp(below[:, 1]) > 20.0, "a tenth of an ampere is far from zero"
    alone = drawing(one(x, measured, measured - 0.001 * np.sin(300.0 * x)))
    assert not points(alone, "before").size
