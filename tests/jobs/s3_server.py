"""An S3-compatible server of the tests' own: moto behind a switch that lets requests fail."""

import socket
import threading
from contextlib import contextmanager

from werkzeug.serving import WSGIRequestHandler, make_server

DENIED = b'<?xml version="1.0"?><Error><Code>AccessDenied</Code><Message>Access Denied</Message></Error>'


class Switch:
    """A WSGI application that passes requests on, or not.

    ``fail`` answers 503; ``refuse`` answers 403; ``cut`` closes the connection after half of an upload. Each holds for
    the next `count` requests that it concerns.
    """

    def __init__(self, application):
        self._application = application
        self.mode, self.count, self.paths = "", 0, []
        self._lock = threading.Lock()

    def set(self, mode, count=10**9):
        self.mode, self.count = mode, count

    def __call__(self, environ, start_response):
        self.paths.append(f"{environ['REQUEST_METHOD']} {environ['PATH_INFO']}")
        with self._lock:
            hit = self.mode and self.count > 0 and (self.mode != "cut" or environ["REQUEST_METHOD"] == "PUT")
            self.count -= bool(hit)
        if not hit:
            return self._application(environ, start_response)
        if self.mode == "fail":
            start_response("503 Slow Down", [("Content-Length", "0")])
            return []
        if self.mode == "refuse":
            headers = [("Content-Type", "application/xml"), ("Content-Length", str(len(DENIED)))]
            start_response("403 Forbidden", headers)
            return [] if environ["REQUEST_METHOD"] == "HEAD" else [DENIED]
        environ["wsgi.input"].read(int(environ.get("CONTENT_LENGTH") or 0) // 2)
        environ["werkzeug.socket"].shutdown(socket.SHUT_RDWR)
        raise ConnectionAbortedError("the connection was cut in the middle of an upload")


class _Quiet(WSGIRequestHandler):
    def log(self, *_):
        pass


@contextmanager
def serving():
    from moto.server import DomainDispatcherApplication, create_backend_app

    switch = Switch(DomainDispatcherApplication(create_backend_app))
    server = make_server("127.0.0.1", 0, switch, threaded=True, request_handler=_Quiet)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}", switch
    finally:
        server.shutdown()
        thread.join()
