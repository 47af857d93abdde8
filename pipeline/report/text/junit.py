"""A comparison as JUnit XML, which a CI server shows as tests.

A failure is a change; an error is what could not be decided although it had to be; skipped is what
was not evaluated and need not be. Nothing undecided shows as passed. Reference: the JUnit schema
of the Apache Ant JUnit task, as CI servers read it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.etree import ElementTree as Xml

from pipeline.records.lot_constant import ConstantResult, Verdict
from pipeline.records.lot_regression import EffectChange, LotRegression

# What XML 1.0 has no place for.
UNFIT = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
MOST_LINES = 200
PASSED = ("pass", "marginal")


def junit_xml(regression: LotRegression) -> bytes:
    """The document [UTF-8]: suites `verdict`, `constants`, `effects`; one test each.

    Parameters
    ----------
    regression
        The comparison of lots.

    """
    root = Xml.Element("testsuites", name=_fit(f"regress {regression.candidate.selector}"))
    _suite(root, "verdict", [_case("verdict", regression.verdict, regression.headline, True)])
    _suite(root, "constants", [_constant(one) for one in regression.constants])
    if regression.effects:
        _suite(root, "effects", [_effect(one) for one in regression.effects])
    totals = {
        name: str(sum(int(suite.get(name, "0")) for suite in root))
        for name in ("tests", "failures", "errors", "skipped")
    }
    root.attrib.update(totals)
    Xml.indent(root, " ")
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root) + b"\n"


def _constant(constant: ConstantResult) -> Xml.Element:
    must = constant.decides and bool(constant.motors)
    case = _case(constant.name, constant.verdict, constant.why, must)
    if constant.motors:
        own = [f"{lot.side} {lot.lot}: mean {lot.mean!r} {constant.unit}" for lot in constant.lots]
        own += [
            f"{m.side} {m.lot} {m.motor_id}: {m.value!r} {constant.unit}, {m.decision}, {m.capture}"
            for m in constant.motors
            if m.outlier or m.decision in ("fail", "conditional_fail", "conditional_pass")
        ]
        Xml.SubElement(case, "system-out").text = _fit("\n".join(own[:MOST_LINES]))
    return case


def _effect(one: EffectChange) -> Xml.Element:
    return _case(f"{one.source}: {one.name}", one.verdict, one.why, False)


def _case(name: str, verdict: Verdict, why: str, must: bool) -> Xml.Element:
    case = Xml.Element("testcase", name=_fit(name), classname="regress", time="0")
    if verdict == "fail":
        Xml.SubElement(case, "failure", message=_fit(why), type="fail")
    elif verdict not in PASSED:
        kind = "error" if must else "skipped"
        child = Xml.SubElement(case, kind, message=_fit(f"{verdict}: {why}"))
        if kind == "error":
            child.set("type", verdict)
    return case


def _suite(root: Xml.Element, name: str, cases: Sequence[Xml.Element]) -> None:
    counted = {
        "tests": len(cases),
        "failures": sum(case.find("failure") is not None for case in cases),
        "errors": sum(case.find("error") is not None for case in cases),
        "skipped": sum(case.find("skipped") is not None for case in cases),
    }
    suite = Xml.SubElement(root, "testsuite", name=name, time="0")
    suite.attrib.update({key: str(number) for key, number in counted.items()})
    suite.extend(cases)


def _fit(text: str) -> str:
    return UNFIT.sub("\ufffd", text)
