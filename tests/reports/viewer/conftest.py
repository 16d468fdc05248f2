"""A page of the viewer in headless Chromium, driven over the pipe of its developer tools."""

import json
import os
import shutil
import subprocess
import sys
import threading
from contextlib import contextmanager

import pytest

from reports.viewer import view as module
from reports.viewer.view import content, whole_page
from weaves.fabric import load_fabric

FABRIC = "gingham"
SIZE = 24
"""Pixels along each side of the pictures of the truth."""

HANGS = 300.0
"""Seconds after which a browser that does not answer is ended."""

_OPTIONS = (
    "--headless", "--no-sandbox", "--hide-scrollbars", "--disable-quic", "--no-first-run", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--remote-debugging-pipe",
)  # fmt: skip

# Chromium reads from descriptor 3 and writes to 4; a shell may refuse descriptors of two digits.
_LAUNCH = """
import fcntl, os, sys
ends = [fcntl.fcntl(int(end), fcntl.F_DUPFD, 10) for end in sys.argv[1:3]]
for number, end in zip((3, 4), ends, strict=True):
    os.dup2(end, number)
os.execvp("chromium", ["chromium", *sys.argv[3:]])
"""


class Page:
    """A page in a browser; `errors` are what it wrote to the console, `requests` the addresses that it asked for."""

    def __init__(self, process, write, read):
        self._process, self._write, self._read, self._count, self._session = process, write, read, 0, None
        self.errors, self.requests = [], []

    def call(self, method, **parameters):
        """Call a method of the developer tools and return its result."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        self._write.write(json.dumps(message).encode() + b"\0")
        self._write.flush()
        guard = threading.Timer(HANGS, self._process.kill)
        guard.start()
        try:
            while (found := self._next()).get("id") != self._count:
                self._note(found)
        finally:
            guard.cancel()
        assert "error" not in found, found["error"]
        return found["result"]

    def open(self, address, before=""):
        """Load an address, after a script."""
        (target,) = [t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page"]
        attached = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=480, height=400, deviceScaleFactor=1, mobile=False)
        self.call("Page.addScriptToEvaluateOnNewDocument", source=before)
        self.call("Page.navigate", url=address)
        ready = "/drawn|still/.test(document.body?.className)"
        self.run(f"new Promise(done => {{ const look = () => {ready} ? done() : setTimeout(look, 50); look(); }})")

    def run(self, expression):
        """Return the value of an expression, waited for if it is a promise."""
        found = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def _next(self):
        text = bytearray()
        while (byte := self._read.read(1)) != b"\0":
            assert byte, "the browser has ended"
            text += byte
        return json.loads(text)

    def _note(self, event):
        kind, about = event.get("method"), event.get("params", {})
        if kind == "Runtime.exceptionThrown":
            self.errors.append(about["exceptionDetails"]["text"])
        elif kind == "Runtime.consoleAPICalled" and about["type"] == "error":
            self.errors.append(str(about["args"]))
        elif kind == "Log.entryAdded" and about["entry"]["level"] == "error":
            self.errors.append(about["entry"]["text"])
        elif kind == "Network.requestWillBeSent":
            self.requests.append(about["request"]["url"])


@contextmanager
def browser(profile):
    """Yield an empty page of a browser."""
    down, up = os.pipe(), os.pipe()
    ends = (str(down[0]), str(up[1]))
    tokens = [sys.executable, "-S", "-c", _LAUNCH, *ends, *_OPTIONS, f"--user-data-dir={profile}", "about:blank"]
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with (
        subprocess.Popen(tokens, pass_fds=(down[0], up[1]), **silent) as own,
        os.fdopen(down[1], "wb") as write,
        os.fdopen(up[0], "rb") as read,
    ):
        os.close(down[0])
        os.close(up[1])
        try:
            yield Page(own, write, read)
        finally:
            own.terminate()


def find(truth, levels, bends, still):
    """Return what the page has of FABRIC at its own width, with pictures of the truth of `truth` pixels."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "DETAILS", levels)
        patch.setattr(module, "BEND_FACTORS", bends)
        patch.setattr(module, "NARROWER", (1.0,))
        patch.setattr(module, "STILL_SIZE", still)
        return content(load_fabric(FABRIC), truth)


def write(found, folder):
    """Return the page's file."""
    path = folder / "gingham.html"
    path.write_text(whole_page(found), encoding="utf-8")
    return path


@contextmanager
def opened(path, profile, before=""):
    """Yield a page, opened from the disk after a script."""
    if shutil.which("chromium") is None:
        pytest.skip("chromium is not installed")
    with browser(profile) as own:
        own.open(path.as_uri(), before)
        yield own


@pytest.fixture(scope="session")
def small():
    """What a small page has: one table, no truth."""
    return find(0, (2,), (1.0,), 32)


@pytest.fixture(scope="session")
def found():
    """What the page has: all levels, two bends, pictures of the truth."""
    return find(SIZE, module.DETAILS, (1.0, 1.4), module.STILL_SIZE)


@pytest.fixture(scope="session")
def written(found, tmp_path_factory):
    """The page's file."""
    return write(found, tmp_path_factory.mktemp("viewer"))


@pytest.fixture(scope="session")
def page(written, tmp_path_factory):
    """The page, opened from the disk."""
    with opened(written, tmp_path_factory.mktemp("profile")) as own:
        yield own


@pytest.fixture
def fresh(page):
    """The page as it was when it was opened."""
    page.run("viewer.reset(), viewer.drawn")
    return page
