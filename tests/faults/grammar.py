"""Folders that follow the grammar of every format, but for one to three of their fields.

Damage to bytes rarely reaches a conversion, for a checksum or a length fails first. Here files are
written anew around each hostile number or text, so that every field of every form gets to the code
that converts it. `case(number)` is the same folder on any machine.
"""

from __future__ import annotations

import io
import json
import random
import struct
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet

from tests.faults.bombs import MAGIC, record, text
from tests.faults.forms import WRITERS, written
from tests.unit.io.recordings import START_NS
from tests.unit.io.test_cdr import JOINT_STATE, NESTED
from tests.unit.io.test_source_maps import KEYSIGHT, MDO, MOTEUS, PICO, RIGOL, SIGLENT, TDS, VESC

Folder = dict[str, bytes]
LONG = "9" * 5000
HUGE = "x" * 1_000_000
NUMBERS = (
    *(LONG, f"-{LONG}", f"0.{LONG}", "1e999999", "-1e999999", "1e-999999", "nan", "NaN", "-nan"),
    *("inf", "-Infinity", "-0", "+5", "1_000", "0x10", "\u0663", "\u00b2", "\u00bd", "1,5"),
    *("", " ", "2147483648", "4294967296", "9223372036854775808", "18446744073709551616", "-1"),
    *("0", "1.5.2", "1e308", "1e5", "1" * 19, "5e-324", "true", "null", "None", "1+2j", "1/2"),
    *("8 9", "-9223372036854775809"),
)
TEXTS = (
    *("\ud800", "a\udfffb", "a\0b", "\u202e\u2066x", "../../etc/passwd", "/", "~", "CON", "", " "),
    *("\n", "\r\n", "\x1b[31m", "<script>&\"'", "%s%n", "{0}", "\ufeff", "\u2028", "\U0001f642"),
    *("=1+1", "|", "#", ": ", "- ", "!!python/object:os.system x", "&a x", "*a", "<<", "? x", "%"),
    *("2026-99-99", "2026-02-30", "9999-12-31T23:59:59-14:00", "0001-01-01T00:00:00+14:00"),
    *("0000-00-00", "12:60", "\u00e9" * 300, "\x7f", "\x01", "[" * 3000, "{" * 3000, "\\"),
    *(
        '"',
        "'",
        "\ue000",
        "\ue001",
        "\uffff",
        "a/b",
        "C:\\x",
        "index",
        "-",
        ".",
        "..",
        "*",
        "[ab]",
        "$HOME",
    ),
)
KEYS = (
    *("contract", "motor_id", "test", "motor_type", "lot", "station", "operator", "started_at"),
    *("winding", "pole_pairs", "slots", "ambient_degc", "pair", "theta_elec_deg", "voltage_kind"),
    *("voltage_timing", "pwm_hz", "vdc_v", "u_rel_current", "u_rel_voltage", "u_rel_torque"),
    *("u_temp_degc", "sha256_rows", "source", "joint", "u_rel_lcr", "kt_peak_nm_a"),
    *("u_kt_peak_nm_a", "r_phase_ohm", "note"),
)
TESTS = ("drive", "resistance", "open_circuit", "spin_down", "current_step", "lcr", "torque_map")
COLUMNS = ("t_s", "iq_a", "vq_v", "omega_mech_rad_s", "vab_v", "ia_a", "theta_mech_rad")
SPELT = {"\ud800": "\\ud800", "a\udfffb": "a\\udfffb", "a\0b": "a\\0b"}


class Draw:
    """Fields of one folder: sound ones, but for a few, chosen by their number in advance."""

    def __init__(self, number: int) -> None:
        self.random = random.Random(number)
        self.hostile = {self.random.randrange(40) for _ in range(self.random.randint(1, 3))}
        self.asked = -1

    def _hit(self) -> bool:
        self.asked += 1
        return self.asked % 40 in self.hostile

    def number(self, sound: str) -> str:
        """A number as text."""
        return self.random.choice(NUMBERS) if self._hit() else sound

    def text(self, sound: str) -> str:
        """A text; one in a hundred hostile ones is a megabyte long."""
        if not self._hit():
            return sound
        if self.random.random() < 0.01:
            return HUGE
        return self.random.choice(TEXTS if self.random.random() < 0.8 else NUMBERS)

    def integer(self, sound: int, bits: int) -> int:
        """A whole number that fits into so many bits."""
        half, any_ = 2 ** (bits - 1), self.random.getrandbits(bits)
        edges = (0, 1, 2 * half - 1, half, half - 1, any_)
        return self.random.choice(edges) if self._hit() else sound

    def value(self, sound: Any) -> Any:
        """A value of JSON."""
        if not self._hit():
            return sound
        odd = (None, True, [], {}, [[1]], {"a": {"b": 1}}, "x", [None, 1], -1, 2**70, "\ud800")
        return self.random.choice((*odd, Raw(self.random.choice(NUMBERS) or "0")))

    def metadata(self) -> dict[str, str]:
        """Keys and values of a capture."""
        said = {"contract": "1", "motor_id": "fuzz", "test": self.random.choice(TESTS)}
        for key in self.random.sample(KEYS, self.random.randint(0, 6)):
            said.setdefault(key, "1")
        numbers = ("pole_pairs", "slots", "u_", "_v", "_hz", "degc", "deg", "_ohm", "_nm_a")
        found = {}
        for key, sound in said.items():
            counts = key.endswith(numbers) or key.startswith("u_")
            found[self.text(key)] = self.number(sound) if counts else self.text(sound)
        return found


class Raw(str):
    """A number of JSON that is written as it stands."""

    __slots__ = ()


def raw(value: str) -> bytes:
    return value.encode("utf-8", "surrogatepass")


def json_text(value: Any) -> str:
    """JSON in which half a surrogate pair is spelt and `Raw` numbers stand as they are."""
    if isinstance(value, Raw):
        return str(value)
    if isinstance(value, dict):
        return "{" + ",".join(f"{json.dumps(k)}:{json_text(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ",".join(map(json_text, value)) + "]"
    return json.dumps(value)


def table(draw: Draw) -> bytes:
    """Header and rows of numbers."""
    columns = [draw.text(name) for name in draw.random.sample(COLUMNS, draw.random.randint(1, 5))]
    if "t_s" not in columns:
        columns.insert(0, "t_s")
    rows = [",".join(columns)]
    rows += [
        ",".join(draw.number(f"{n * 0.5 + k}") for k in range(len(columns)))
        for n in range(draw.random.choice((0, 1, 30)))
    ]
    return raw("\n".join(rows) + "\n")


def csv_capture(draw: Draw) -> Folder:
    head = "".join(f"# {key}: {value}\n" for key, value in draw.metadata().items())
    return {"a.csv": raw(head) + table(draw)}


def checksummed(draw: Draw) -> Folder:
    digest = draw.text("ab" * 32)
    said = "# contract: 1\n# motor_id: m\n# test: drive\n"
    said += f"# sha256_rows: {digest}/{draw.number('30')}\n"
    return {"a.csv": raw(said) + table(draw)}


def sound(draw: Draw) -> Folder:
    """A resistance test that is refused for nothing but its metadata: they reach every output."""
    said = {"contract": "1", "motor_id": draw.text(f"m{draw.random.random()}"), "pair": "ab"}
    said |= {"test": "resistance", "ambient_degc": draw.number("25"), "slots": draw.number("12")}
    texts = ("motor_type", "lot", "station", "operator", "started_at", "note", "winding")
    said |= {key: draw.text("wye" if key == "winding" else "x1") for key in texts}
    said |= {key: draw.number("0.01") for key in ("u_rel_current", "u_temp_degc", "r_phase_ohm")}
    said[draw.text("free")] = draw.text("y")
    head = "".join(f"# {key}: {value}\n" for key, value in said.items())
    rows = ["t_s,vab_v,ia_a,temp_winding_degc"]
    for n in range(600):
        current = 0.5 * (n // 100 + 1) * (-1) ** (n // 100)
        noise = 1e-4 * draw.random.gauss(0.0, 1.0), 1e-4 * draw.random.gauss(0.0, 1.0)
        rows.append(f"{n * 0.01},{1.2 * current + noise[0]:.6f},{current + noise[1]:.6f},25.0")
    return {"a.csv": raw(head + "\n".join(rows) + "\n")}


def with_sidecar(draw: Draw) -> Folder:
    lines = []
    for key, value in draw.metadata().items():
        plain = draw.random.random() < 0.5
        quoted = f'"{SPELT.get(value, value)}"'
        lines.append(f"{SPELT.get(key, key)}: {value if plain else quoted}")
    extra = ("", "x: !!int 5\n", "x: &a [1]\ny: *a\n", "x: " + "[" * 2000, "--- a\n--- b\n")
    extra += (
        "\t- x",
        "x: !!binary aGk=\n",
        "x: 2026-13-45\n",
        'x: "\\U7fffffff"\n',
        'x: "\\ud800"\n',
    )
    extra += ("%YAML 9" + "9" * 5000 + ".1\n---\nx: 1\n", "x: !!float .nan\n", "? [a]\n: b\n")
    tail = draw.random.choice(extra) if draw.random.random() < 0.3 else ""
    return {"a.csv": table(draw), "a.meta.yaml": raw("\n".join([*lines, tail]))}


def with_manifest(draw: Draw) -> Folder:
    said = draw.metadata()
    head = ",".join([draw.text("file"), *said])
    row = ",".join([draw.text("a.csv"), *said.values()])
    return {"a.csv": table(draw), "manifest.csv": raw(f"{head}\n{row}\n")}


def mcap(
    draw: Draw,
    schema: tuple[str, str, bytes],
    encoding: str,
    payloads: list[bytes],
) -> Folder:
    """An MCAP without chunks and checksums, every text and number of its records drawn."""
    pairs = b"".join(text(raw(k)) + text(raw(v)) for k, v in draw.metadata().items())
    said = record(12, text(raw(draw.text("capture"))) + text(pairs))
    name, form, data = schema
    described = struct.pack("<H", draw.integer(1, 16)) + text(raw(draw.text(name)))
    described = record(3, described + text(raw(draw.text(form))) + text(data))
    channel = struct.pack("<HH", draw.integer(1, 16), draw.integer(1, 16))
    channel += text(raw(draw.text("/s"))) + text(raw(draw.text(encoding))) + text(b"")
    body = [record(1, text(raw(draw.text(""))) + text(b"")), said, described, record(4, channel)]
    for n, payload in enumerate(payloads):
        time = draw.integer(START_NS + n * 1_000_000, 64)
        head = struct.pack("<HIQQ", draw.integer(1, 16), n, time, time)
        body.append(record(5, head + payload))
    end = record(15, bytes(4)) + record(2, bytes(20))
    return {"a.mcap": MAGIC + b"".join(body) + end + MAGIC}


def mcap_json(draw: Draw) -> Folder:
    payloads = []
    for n in range(draw.random.choice((1, 12))):
        row: dict[str, Any] = {"t_s": draw.value(n / 1000.0)}
        row |= {draw.text(k): draw.value(n * 0.5) for k in ("iq_a", "omega_mech_rad_s")}
        if draw.random.random() < 0.3:
            row["nested"] = {"vq_v": draw.value(1.0), "name": draw.value("x")}
        if draw.random.random() < 0.05:
            payloads.append(b'{"a":' * 50_000)
        payloads.append(json_text(row).encode())
    return mcap(draw, ("S", draw.random.choice(("jsonschema", "")), b"{}"), "json", payloads)


def mcap_ros2(draw: Draw) -> Folder:
    joint = draw.random.random() < 0.3
    kinds = ("float64", "float64[]", "float32[3]", "string", "string[]", "int64[<=4]", "bool")
    kinds += ("pkg/Inner", "pkg/Inner[]", "string<=9", "float64[<=9]", "Header", "wstring")
    lines = []
    for name in draw.random.sample(COLUMNS, 4):
        kind = draw.random.choice(kinds)
        if draw.random.random() < 0.3:
            bound = draw.number("3")
            bounds = (f"float64[{bound}]", f"string<={bound}", f"float32[<={bound}]")
            kind = draw.random.choice(bounds)
        lines.append(f"{kind} {draw.text(name)}")
    definition = "\n".join(lines) + "\n" + NESTED[NESTED.index("=====") :]
    root = "pkg/A"
    if joint:
        root, definition = "sensor_msgs/JointState", JOINT_STATE
    body = b"\0\1\0\0" + b"".join(struct.pack("<I", draw.integer(3, 32)) for _ in range(12))
    payloads = [body + struct.pack("<d", n * 0.5) * 4 for n in range(3)]
    return mcap(draw, (root, "ros2msg", raw(definition)), "cdr", payloads)


# Kind of a descriptor's field, and its wire type.
PROTOBUF = ((1, 1), (2, 5), (3, 0), (6, 1), (7, 5), (8, 0), (9, 2), (11, 2), (12, 2), (17, 0))


def mcap_protobuf(draw: Draw) -> Folder:
    """Messages of four fields, whose kinds and lengths may contradict the bytes."""
    files = FileDescriptorSet()
    file = files.file.add(name="m.proto", package="p", syntax=draw.random.choice(("proto3", "")))
    message = file.message_type.add(name="M")
    wires = []
    for number, name in enumerate(draw.random.sample(COLUMNS, 4), 1):
        field: Any = message.field.add()
        kind, wire = draw.random.choice(PROTOBUF)
        wires.append((number, wire))
        field.name, field.number, field.type = name, draw.integer(number, 31), kind
        field.label = draw.random.choice((1, 1, 3)) if wire == 2 else 1
        if draw.random.random() < 0.05:
            field.type, field.label = draw.random.randint(1, 18), draw.random.choice((1, 2, 3))
        if field.type == FieldDescriptorProto.TYPE_MESSAGE:
            field.type_name = draw.text(".p.Inner").replace("\ud800", "").replace("\udfff", "")
    inner = file.message_type.add(name="Inner").field.add()
    inner.name, inner.number, inner.type, inner.label = "vq_v", 1, 1, 1
    payloads = []
    for n in range(3):
        double = struct.pack("<d", n * 0.5)
        value = {0: b"\x05", 1: double, 5: bytes(4)}
        value[2] = bytes([draw.integer(9, 7)]) + b"\x09" + double
        payloads.append(b"".join(bytes([k << 3 | wire]) + value[wire] for k, wire in wires))
    return mcap(draw, ("p.M", "protobuf", files.SerializeToString()), "protobuf", payloads)


def moteus_sweep(draw: Draw) -> Folder:
    runs = [{"omega": draw.value(70.0 + n), draw.text("y"): draw.value(0.9)} for n in range(3)]
    document: Any = {
        draw.text("raw"): draw.value({draw.number("2.0"): draw.value(runs)}),
        "params": draw.value({"poles": draw.value(14)}),
    }
    return {"ld_mj5208.json": json_text(document).encode()}


def numpy_archive(draw: Draw) -> Folder:
    shape = (draw.integer(2, 8) % 5, 2)
    kind = draw.random.choice(("c16", "f8", "i8", "u1", "U3", "M8[s]", "?", "f2"))
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name in ("i_s_dq", "psi_s_dq"):
            inner = io.BytesIO()
            np.save(inner, np.ones(shape).astype(kind))
            data = bytearray(inner.getvalue())
            header = draw.text("")
            if header:
                said = raw(header)[:60]
                data[10 : 10 + len(said)] = said
            if draw.random.random() < 0.2:
                shaped = f"({draw.number('2')}, 2)".encode()
                data = bytearray(bytes(data).replace(f"({shape[0]}, 2)".encode(), shaped))
            archive.writestr(f"{name}.npy", bytes(data))
    return {"baldor_map.npz": stream.getvalue()}


def oscilloscope(draw: Draw) -> Folder:
    """A foreign table in which one to three fields of any line are replaced."""
    sound = draw.random.choice((RIGOL, SIGLENT, MDO, TDS, PICO, VESC, MOTEUS, KEYSIGHT + "0,1,2\n"))
    mark = ";" if sound is VESC else ","
    lines = [line.split(mark) for line in sound.split("\n")]
    for _ in range(draw.random.randint(1, 3)):
        row = draw.random.choice(lines)
        place = draw.random.randrange(len(row))
        row[place] = draw.random.choice(NUMBERS + TEXTS)
    said = "motor_id: fuzz\ntest: drive\n"
    body = "\n".join(mark.join(row) for row in lines)
    return {"a.csv": raw(body), "a.meta.yaml": said.encode()}


def recorder_form(draw: Draw) -> Folder:
    """A file of one of the forms that recorders and tools write."""
    return written(draw.random.choice(sorted(WRITERS)), draw)


def recorder_form_again(draw: Draw) -> Folder:
    """As many files again, for there are eight such forms."""
    return recorder_form(draw)


FORMS: tuple[Callable[[Draw], Folder], ...] = (
    csv_capture,
    checksummed,
    sound,
    with_sidecar,
    with_manifest,
    mcap_json,
    mcap_ros2,
    mcap_protobuf,
    moteus_sweep,
    numpy_archive,
    oscilloscope,
    recorder_form,
    recorder_form_again,
)


def case(number: int) -> tuple[str, Folder]:
    """The form and the files of one folder; each form in turn."""
    form = FORMS[number % len(FORMS)]
    return form.__name__, form(Draw(number))


def source_map(number: int) -> bytes:
    """A source map in which up to three values are hostile."""
    draw = Draw(number)
    parts = [
        f"about: {draw.text('a bench')}",
        "recognise:",
        f"  header: '{draw.text('^T;').replace(chr(39), '')}'",
        f"  files: [{draw.text('a.csv')}]",
        "layout:",
        f"  separator: {draw.text(';')}",
        f"  skip_lines: {draw.number('0')}",
        f"  encoding: {draw.text('utf-8')}",
        f"  time_start: '{draw.text('T,([0-9]+)').replace(chr(39), '')}'",
        "fields:",
        f"  T: {{column: t_s, unit: {draw.text('ms')}, scale: {draw.number('2')}}}",
        f"  I: {{column: {draw.text('iq_a')}, sign: {draw.number('-1')}}}",
        f"  J: {{column: {draw.text('id_a')}, offset: {draw.number('0')}}}",
        "time:",
        f"  increment_s: {draw.number('0.1')}",
        f"  wraps_at: {draw.number('5')}",
        "metadata:",
        f"  test: {draw.text('drive')}",
        f"  {draw.text('station')}: {draw.text('hall')}",
    ]
    return raw("\n".join(parts) + "\n")
