"""An S3 server on the loopback that fails every so many calls, as stores do."""

import os
import threading
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest


class Failing:
    """A WSGI application that answers every ``every``-th call with an error of the server."""

    def __init__(self, application: Any, every: int) -> None:
        self.application, self.every = application, every
        self.calls = self.failed = 0
        self._lock = threading.Lock()

    def __call__(self, environ: dict[str, Any], start: Any) -> Any:
        with self._lock:
            self.calls += 1
            fail = self.every and self.calls % self.every == 0
            self.failed += bool(fail)
        if fail:
            environ["wsgi.input"].read(int(environ.get("CONTENT_LENGTH") or 0))
            head = [("Content-Type", "text/plain"), ("Content-Length", "0")]
            start("500 Internal Server Error", head)
            return [b""]
        return self.application(environ, start)


@contextmanager
def s3_server(monkeypatch: pytest.MonkeyPatch, every: int = 0) -> Iterator[Failing]:
    """The server, with the environment that leads s3fs to it, here and in processes started from here."""
    from moto.server import DomainDispatcherApplication, create_backend_app
    from werkzeug.serving import make_server

    application = Failing(DomainDispatcherApplication(create_backend_app), 0)
    server = make_server("127.0.0.1", 0, application, threaded=True)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    for name, value in {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{server.port}",
        "AWS_ACCESS_KEY_ID": "testing",
        "AWS_SECRET_ACCESS_KEY": "testing",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_MAX_ATTEMPTS": "1",  # what is tried again is ours
    }.items():
        monkeypatch.setenv(name, value)
    for name in [n for n in os.environ if n.lower() in ("http_proxy", "https_proxy", "all_proxy")]:
        monkeypatch.delenv(name)
    try:
        url = f"http://127.0.0.1:{server.port}/moto-api/reset"
        reset = urllib.request.Request(url, method="POST")
        urllib.request.urlopen(reset).close()  # what another test has left
        application.every = every
        yield application
    finally:
        server.shutdown()
        thread.join()
