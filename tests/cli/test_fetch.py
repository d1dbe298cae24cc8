"""`--fetch`: models of a world come from Fuel into its cache. A server on the loopback stands for
Fuel.
"""

import hashlib
import io
import json
import socket
import ssl
import stat
import threading
import zipfile
from datetime import datetime, timedelta
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

from ddenv.cli.fetch import fetch_with_bar
from ddenv.errors import UserError
from ddenv.runs.experiment import load_parts, scenario_for_world, scenario_named
from ddenv.world.files import fuel_download
from ddenv.world.files.fuel import CACHES, HOSTS
from ddenv.world.files.roots import VARIABLES
from tests.command import in_process

FUEL = f"https://{HOSTS[0]}/1.0"
SHAPE = "<collision name='c'><geometry><box><size>1 1 1</size></box></geometry></collision>"
CRATE = (
    "<sdf version='1.6'><model name='crate'><static>1</static><link "
    f"name='l'>{SHAPE}</link></model></sdf>"
)


@pytest.fixture(scope="module")
def certificate(tmp_path_factory) -> Path:
    """A certificate for Fuel's name, with its key, which only a test that says so trusts."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, HOSTS[0])])
    now = datetime.now()
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=2))
        .not_valid_after(now + timedelta(days=2))
        .add_extension(x509.SubjectAlternativeName([x509.DNSName(HOSTS[0])]), critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
    file = tmp_path_factory.mktemp("tls") / "fuel.pem"
    secret = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    file.write_bytes(secret + made.public_bytes(serialization.Encoding.PEM))
    return file


class Fuel:
    """What the server answers by path: a body, its headers, and the code; and what it was asked
    for.
    """

    def __init__(self):
        self.answers = {}
        self.asked = []
        self.end = threading.Event()

    def has(self, name, body, version="1", *, asked_as="tip", code=200, **headers):
        path = f"/1.0/Some One/models/{name}/{asked_as}/{name}.zip"
        headers = {"Content-Length": str(len(body)), "X-Ign-Resource-Version": version} | {
            key.replace("_", "-"): value for key, value in headers.items()
        }
        self.answers[path] = code, headers, body


@pytest.fixture
def fuel(certificate, monkeypatch, tmp_path):
    found = Fuel()

    class Answer(BaseHTTPRequestHandler):
        def do_GET(self):
            path = unquote(self.path)
            found.asked.append(path)
            code, headers, body = found.answers.get(path, (404, {}, b""))
            if body is None:
                found.end.wait()
                return
            self.send_response(code)
            for key, value in headers.items():
                if value:
                    self.send_header(key, value)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Answer)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate)
    # Each connection shakes hands in its own thread.
    server.socket = context.wrap_socket(
        server.socket, server_side=True, do_handshake_on_connect=False
    )
    # A client that hangs up is what some tests are about.
    server.handle_error = lambda *_: None
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    here = [(socket.AF_INET, socket.SOCK_STREAM, 6, "", server.server_address)]
    monkeypatch.setattr(
        socket,
        "getaddrinfo",
        lambda host, port, *_: here if (host, port) == (HOSTS[0], 443) else [],
    )
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    for variable in (*VARIABLES, *CACHES, "https_proxy", "HTTPS_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    yield found
    found.end.set()
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture
def check(fuel, tmp_path, monkeypatch, capsys):
    """Checks a world that includes models of Fuel; returns what is said."""

    def run(*uris, fetch=True):
        file = tmp_path / "w.sdf"
        models = "".join(
            f"<include><uri>{uri}</uri><name>m{at}</name></include>" for at, uri in enumerate(uris)
        )
        file.write_text(f"<sdf version='1.6'><world name='w'>{models}</world></sdf>")
        return in_process(
            monkeypatch, capsys, "world", "check", file, "--json", *(["--fetch"] if fetch else [])
        )

    return run


@pytest.fixture
def cache(tmp_path) -> Path:
    return tmp_path / "home" / ".gz" / "fuel"


def packed(files, **entries) -> bytes:
    """A zip file."""
    body = io.BytesIO()
    with zipfile.ZipFile(body, "w", zipfile.ZIP_DEFLATED) as zipped:
        for name, text in files.items():
            zipped.writestr(name, text)
        for name, info in entries.items():
            zipped.writestr(info, name)
    return body.getvalue()


def files_in(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if not path.is_dir())


def test_models_come_with_those_that_they_name_and_gazebo_finds_them_too(fuel, check, cache):
    lamp = f"<include><uri>{FUEL}/Some One/models/Lamp/2</uri></include>"
    hall = (
        "<sdf version='1.6'><model name='hall'><static>1</static><link "
        f"name='l'>{SHAPE}</link>{lamp}</model></sdf>"
    )
    body = packed(
        {
            "model.config": "<model><sdf version='1.6'>model.sdf</sdf></model>",
            "model.sdf": hall,
            "meshes/": "",
        }
    )
    fuel.has("Big Hall", body, "7")
    fuel.has("Lamp", packed({"model.sdf": CRATE, "meshes/a.dae": "x"}), "2", asked_as="2")
    uri = f"{FUEL}/Some%20One/models/Big%20Hall"
    refused = check(uri, fetch=False)
    assert refused.returncode == 2 and fuel.asked == []
    assert (
        f"--fetch downloads this model from Fuel, as does gz fuel download -u {uri}\n"
        in refused.stderr
    )
    done = check(uri)
    assert done.returncode == 0, done.stderr
    models = cache / HOSTS[0] / "some one" / "models"
    assert files_in(cache) == files_in_both(models, cache)
    record = json.loads((models / "big hall" / "7" / "ddenv-fetched.json").read_text())
    assert record["sha256"] == hashlib.sha256(body).hexdigest() and record["size"] == len(body)
    assert record["sha256"] in done.stderr and len(done.stderr.splitlines()) == 2
    assert not any(path.stat().st_mode & 0o111 for path in cache.rglob("*") if path.is_file())
    assert check(uri, fetch=False).returncode == 0 and check(uri).returncode == 0
    assert len(fuel.asked) == 2


def test_models_that_a_robot_names_come_too(fuel, cache, tmp_path):
    wheel = f"<mesh><uri>{FUEL}/Some%20One/models/Wheel/tip/files/wheel.obj</uri></mesh>"
    robot = tmp_path / "robot.sdf"
    shape = f"<collision name='c'><geometry>{wheel}</geometry></collision>"
    robot.write_text(
        f"<sdf version='1.6'><model name='robot'><link name='l'>{shape}</link></model></sdf>"
    )
    world = tmp_path / "w.sdf"
    world.write_text(
        "<sdf version='1.6'><world "
        f"name='w'>{CRATE.partition('>')[2].removesuffix('</sdf>')}</world></sdf>"
    )
    fuel.has(
        "Wheel",
        packed(
            {"model.sdf": CRATE, "wheel.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3 4\n"}
        ),
    )
    scenario = scenario_for_world(world, (0, 9, 1, 0), (9, 9)).model_dump(mode="json")
    scenario["robot"]["model"] = str(robot)
    file = tmp_path / "s.yaml"
    file.write_text(json.dumps(scenario))
    given = {"spawn": None, "goal": None, "world": None}
    with pytest.raises(UserError, match="this model from Fuel"):
        load_parts(scenario_named(str(file), given))
    _, found = load_parts(scenario_named(str(file), given | {"fetch": fetch_with_bar}))
    assert len(found.collisions) > 0
    assert (
        len(fuel.asked) == 1
        and (cache / HOSTS[0] / "some one" / "models" / "wheel" / "1" / "wheel.obj").is_file()
    )


def files_in_both(models: Path, cache: Path) -> list[str]:
    names = ("big hall/7/ddenv-fetched.json", "big hall/7/model.config", "big hall/7/model.sdf")
    names += ("lamp/2/ddenv-fetched.json", "lamp/2/meshes/a.dae", "lamp/2/model.sdf")
    return sorted(str((models / name).relative_to(cache)) for name in names)


def link() -> zipfile.ZipInfo:
    info = zipfile.ZipInfo("textures")
    info.external_attr = (stat.S_IFLNK | 0o777) << 16
    return info


def damaged() -> bytes:
    body = bytearray(packed({"model.sdf": CRATE}))
    body[body.index(b"model.sdf") + 9 + 20] ^= 0xFF
    return bytes(body)


GOOD = packed({"model.sdf": CRATE})
BAD = {
    "a page": (
        b"<html>Sign in</html>",
        {"Content_Type": "text/html"},
        "the server sent text/html, which is no zip",
    ),
    "an error": (b"", {"code": 503}, "the server answered 503 "),
    "another version": (
        GOOD,
        {"version": "../../x"},
        "the server sent version '../../x' in place of the newest one",
    ),
    "no version": (GOOD, {"version": ""}, "the server sent version ''"),
    "10 GB": (GOOD, {"Content_Length": "10000000000"}, "is larger than 1000 MB, the maximum"),
    "half of it": (GOOD, {"Content_Length": str(len(GOOD) + 9)}, "the connection broke after"),
    "another file": (packed({"report.pdf": "x"}), {}, "holds neither model.config nor an SDF file"),
    "a climbing file": (
        packed({"model.sdf": CRATE, "../../evil.sdf": "x"}),
        {},
        "'../../evil.sdf', which leads out",
    ),
    "an absolute file": (
        packed({"model.sdf": CRATE, "/tmp/evil.sdf": "x"}),
        {},
        "'/tmp/evil.sdf', which leads out",
    ),
    "a link": (
        packed({"model.sdf": CRATE}, **{"/etc": link()}),
        {},
        "'textures', which leads out of its folder",
    ),
    "other bytes": (damaged(), {}, "the zip file that the server sent is damaged: "),
    "plain http": (
        b"",
        {"code": 302, "Location": "http://127.0.0.1/x.zip"},
        "unknown url type: http",
    ),
    "nothing": (None, {}, "the server sent nothing for 0.2 s"),
}


@pytest.mark.parametrize("name", BAD)
def test_whatever_else_a_server_sends_leaves_nothing_behind(
    fuel, check, cache, tmp_path, monkeypatch, name
):
    body, options, reason = BAD[name]
    if body is None:
        monkeypatch.setattr(fuel_download, "TIMEOUT", 0.2)
        fuel.answers["/1.0/Some One/models/Crate/tip/Crate.zip"] = (200, {}, None)
    else:
        fuel.has("Crate", body, **options)
    said = check(f"{FUEL}/Some One/models/Crate")
    assert said.returncode == 2 and said.stdout == ""
    (line,) = said.stderr.splitlines()
    assert f"{FUEL}/Some%20One/models/Crate cannot be fetched: " in line and reason in line
    assert (
        "leave it out with --stand-in 'https://fuel.gazebosim.org/1.0/Some One/models/Crate=none'"
        in line
    )
    assert files_in(tmp_path) == ["w.sdf"] and list(cache.iterdir()) == []


def test_a_stream_without_an_end_is_stopped_at_the_limit(fuel, check, tmp_path, monkeypatch):
    monkeypatch.setattr(fuel_download, "ARCHIVE_LIMIT", 1_000_000)
    fuel.has("Crate", bytes(3_000_000), Content_Length="")
    assert "is larger than 1 MB, the maximum" in check(f"{FUEL}/Some One/models/Crate").stderr
    assert files_in(tmp_path) == ["w.sdf"]


def test_what_unpacks_to_too_much_is_refused(fuel, check, tmp_path, monkeypatch):
    monkeypatch.setattr(fuel_download, "FILES_LIMIT", 1_000_000)
    fuel.has("Crate", packed({"model.sdf": CRATE, "big.bin": bytes(2_000_000)}))
    assert "files or 1 MB, the maximum" in check(f"{FUEL}/Some One/models/Crate").stderr
    assert files_in(tmp_path) == ["w.sdf"]


def test_a_model_that_is_not_there_and_a_server_that_nobody_vouches_for(
    fuel, check, monkeypatch, tmp_path
):
    uri = f"{FUEL}/Some One/models/Crate"
    assert "is not in Fuel; leave it out" in check(uri).stderr
    monkeypatch.setenv("SSL_CERT_FILE", str(tmp_path / "none.pem"))
    said = check(uri)
    assert (
        said.returncode == 2 and "certificate verify failed" in said.stderr and len(fuel.asked) == 1
    )


def test_stopped_with_ctrl_c(fuel, check, cache, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    fuel.has("Crate", GOOD)
    monkeypatch.setattr(fuel_download, "_unpack", interrupt)
    assert check(f"{FUEL}/Some One/models/Crate").returncode == 130
    assert list(cache.iterdir()) == []


def test_a_cache_that_leads_elsewhere_and_one_with_half_a_model(fuel, check, cache, tmp_path):
    fuel.has("Crate", GOOD)
    uri = f"{FUEL}/Some One/models/Crate"
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (cache / HOSTS[0]).mkdir(parents=True)
    (cache / HOSTS[0] / "some one").symlink_to(elsewhere)
    said = check(uri)
    assert said.returncode == 2 and "is a link that leads out of Fuel's cache" in said.stderr
    assert list(elsewhere.iterdir()) == []
    (cache / HOSTS[0] / "some one").unlink()
    half = cache / HOSTS[0] / "some one" / "models" / "crate" / "1"
    (half / "meshes").mkdir(parents=True)
    said = check(uri)
    assert said.returncode == 2 and f"{half} has neither model.config nor model.sdf" in said.stderr
    assert f"{half} was there already, and was left as it is" in said.stderr
    assert files_in(cache) == []
