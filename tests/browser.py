"""A page in headless Chromium, driven over the pipe of its developer tools."""

import json
import os
import shutil
import subprocess
import sys
import threading
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest

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
    """A page in a browser.

    `messages` are what it wrote to the console, `errors` those that are errors, `requests` the addresses it asked for.
    """

    def __init__(self, process, write, read):
        self._process, self._write, self._read, self._count, self._session = process, write, read, 0, None
        self.messages, self.errors, self.requests = [], [], []

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
            while (answer := self._next()).get("id") != self._count:
                self._note(answer)
        finally:
            guard.cancel()
        assert "error" not in answer, answer["error"]
        return answer["result"]

    def open(self, address, ready, before="", size=(480, 400, 1.0), scheme="light"):
        """Load an address after the script `before`, and wait until the expression `ready` is true.

        `size` has width and height in pixels of CSS, and screen pixels for each of them; `scheme` is "light" or "dark".
        """
        (target,) = [t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page"]
        attached = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        width, height, ratio = size
        metrics = {"width": width, "height": height, "deviceScaleFactor": ratio, "mobile": width < 480}
        self.call("Emulation.setDeviceMetricsOverride", **metrics)
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.call("Page.addScriptToEvaluateOnNewDocument", source=before)
        self.call("Page.navigate", url=address)
        self.run(f"new Promise(done => {{ const look = () => {ready} ? done() : setTimeout(look, 50); look(); }})")

    def run(self, expression):
        """Return the value of an expression, waited for if it is a promise."""
        answer = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, (answer["exceptionDetails"], self.errors)
        return answer["result"].get("value")

    def _next(self):
        text = bytearray()
        while (byte := self._read.read(1)) != b"\0":
            assert byte, "the browser has ended"
            text += byte
        return json.loads(text)

    def _note(self, event):
        kind, about = event.get("method"), event.get("params", {})
        if kind in ("Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded"):
            self.messages.append(str(about))
        if kind == "Runtime.exceptionThrown":
            self.errors.append(about["exceptionDetails"]["text"])
        elif kind == "Runtime.consoleAPICalled" and about["type"] == "error":
            self.errors.append(str(about["args"]))
        elif kind == "Log.entryAdded" and about["entry"]["level"] == "error":
            self.errors.append(about["entry"]["text"])
        elif kind == "Network.requestWillBeSent":
            self.requests.append(about["request"]["url"])


@contextmanager
def opened(address, profile, *options, ready, **how):
    """Yield a page as `Page.open` loads it; skip the test without Chromium."""
    if shutil.which("chromium") is None:
        pytest.skip("chromium is not installed")
    down, up = os.pipe(), os.pipe()
    ends = (str(down[0]), str(up[1]))
    tokens = [sys.executable, "-S", "-c", _LAUNCH, *ends, *_OPTIONS, *options, f"--user-data-dir={profile}"]
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with (
        subprocess.Popen([*tokens, "about:blank"], pass_fds=(down[0], up[1]), **silent) as own,
        os.fdopen(down[1], "wb") as write,
        os.fdopen(up[0], "rb") as read,
    ):
        os.close(down[0])
        os.close(up[1])
        try:
            page = Page(own, write, read)
            page.open(address, ready, **how)
            yield page
        finally:
            own.terminate()


@contextmanager
def served(folder):
    """Yield the address at which the files of a folder are served."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(SimpleHTTPRequestHandler, directory=folder)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
