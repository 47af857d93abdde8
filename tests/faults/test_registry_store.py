"""The registry in an object store: a live server that speaks S3, reached as users reach one."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from urllib.error import URLError
from urllib.request import urlopen

import pytest

from pipeline.__main__ import main
from pipeline.io.registry.exports import FOLDER
from pipeline.io.registry.store import Registry
from tests.registered import NOON, document, version_of

pytestmark = pytest.mark.slow
BUCKET = "fleet"
# One request at a time: moto's own command answers several at once, and between "is it there?" and
# "put it" another may come in, which the conditional write of a store rules out.
SERVE = """
import sys
from moto.moto_server.werkzeug_app import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import run_simple
app = DomainDispatcherApplication(create_backend_app)
run_simple("127.0.0.1", int(sys.argv[1]), app, threaded=False)
"""


@pytest.fixture(scope="module")
def store() -> Iterator[dict[str, str]]:
    """Options for an empty bucket of a server on loopback."""
    import boto3

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    words = [sys.executable, "-c", SERVE, str(port)]
    server = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    options = {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
        "AWS_ALLOW_HTTP": "true",
        "AWS_REGION": "us-east-1",
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
    }
    try:
        await_server(options["AWS_ENDPOINT_URL"])
        client(boto3, options).create_bucket(Bucket=BUCKET)
        yield options
    finally:
        server.kill()
        server.wait()


def await_server(url: str) -> None:
    deadline = time.monotonic() + 60.0
    while True:
        try:
            urlopen(url).close()
        except URLError:
            assert time.monotonic() < deadline
            time.sleep(0.1)
        else:
            return


def client(boto3: Any, options: dict[str, str]) -> Any:
    return boto3.client(
        "s3",
        endpoint_url=options["AWS_ENDPOINT_URL"],
        region_name=options["AWS_REGION"],
        aws_access_key_id="test",
        aws_secret_access_key="test",
    )


def write(place: str, options: dict[str, str], numbers: range) -> None:
    registry = Registry(place, options)
    for number in numbers:
        registry.publish([document("joint/1", number)], NOON)


def write_at_once(place: str, options: dict[str, str], spans: list[range]) -> None:
    with ProcessPoolExecutor(len(spans), get_context("spawn")) as writers:
        for done in [writers.submit(write, place, options, span) for span in spans]:
            done.result()


def test_the_commands_work_on_a_bucket(
    store: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`run` publishes there, twice the same; list, show, at, diff, approve and verify read it."""
    import boto3

    place = f"s3://{BUCKET}/of runs"
    words = [f"registry={place}", *(f"registry_options.{k}={v}" for k, v in store.items())]
    folder, output = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    for scale, sign in (("ia_a", 1), ("ib_a", -1)):
        rows = "".join(f"{n / 1000},{n // 50},{2 * sign * (n // 50)},25.0\n" for n in range(400))
        head = "# contract: 1\n# motor_id: m/1\n# test: resistance\n# pair: ab\n"
        (folder / "r.csv").write_text(f"{head}t_s,vab_v,{scale},temp_winding_degc\n{rows}")
        run = ["run", f"input={folder}", f"output={output}", "recordings=false", "report=false"]
        for new in ("1 new, 0 known", "0 new, 1 known"):
            assert main([*run, *words]) in (0, 4)
            assert new in capsys.readouterr().out
    told = {}
    for action in (
        ["list"],
        ["show", "m/1"],
        ["at", "2999-01-01"],
        ["diff", "m/1", "from=1", "to=2"],
        ["verify"],
    ):
        assert main(["registry", *action, *words]) == 0
        told[action[0]] = capsys.readouterr().out
    assert "1 motor, 2 versions" in told["list"]
    assert "2 versions, 0 decisions, all of it as published" in told["verify"]
    listed = client(boto3, store).list_objects_v2(Bucket=BUCKET, Prefix=f"of runs/{FOLDER}/")
    (sheet,) = (output / "datasheets").iterdir()
    version = json.loads(sheet.read_bytes())["version"]
    names = [one["Key"].rsplit("/", 1)[-1] for one in listed["Contents"]]
    assert len(names) == 2 and f"{version}.json" in names


def test_writers_at_once_lose_and_double_none(store: dict[str, str]) -> None:
    """4 writers of 5 versions each: 20 of 20; the same 5 by 4 writers, twice: 5 of 5."""
    own, same = f"s3://{BUCKET}/own", f"s3://{BUCKET}/same"
    write_at_once(own, store, [range(5 * k, 5 * k + 5) for k in range(4)])
    for _ in range(2):
        write_at_once(same, store, [range(5)] * 4)
    for place, count in ((own, 20), (same, 5)):
        registry = Registry(place, store)
        events = registry.events()
        assert [event.revision for event in events] == list(range(1, count + 1))
        assert {event.version for event in events} == {
            version_of("joint/1", number) for number in range(count)
        }
        found = registry.verify()
        assert (found.versions, found.faults) == (count, ())


def test_a_store_that_is_not_there_is_one_line_and_exit_5(
    store: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    """A bucket that does not exist: no traceback, no colours, one line that names the registry."""
    words = [f"registry_options.{k}={v}" for k, v in store.items()]
    assert main(["registry", "list", "registry=s3://no-such-bucket/r", *words]) in (2, 5)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ") and "no-such-bucket" in line
    assert "test" not in line.replace("latest", "")
