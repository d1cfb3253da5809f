"""An S3-compatible store in memory: what s3cmd asks of one, without signatures."""

from __future__ import annotations

import hashlib
import http.server
import threading
import urllib.parse
from xml.sax.saxutils import escape


class _Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    objects: dict[str, bytes]  # by /BUCKET/KEY

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        pass

    def _answer(self, status: int, body: bytes, tag: str = "") -> None:
        self.send_response(status)
        if tag:
            self.send_header("ETag", f'"{tag}"')
        self.send_header("Last-Modified", "Sun, 01 Nov 2026 12:00:00 GMT")
        self.send_header("Content-Type", "application/xml")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def _list(self, bucket: str, query: dict[str, list[str]]) -> None:
        prefix = query.get("prefix", [""])[0]
        rows = ""
        for path, data in sorted(self.objects.items()):
            key = path.removeprefix(f"/{bucket}/")
            if path != key and key.startswith(prefix):
                tag = hashlib.md5(data).hexdigest()
                rows += f"<Contents><Key>{escape(key)}</Key><LastModified>2026-11-01T12:00:00.000Z</LastModified>"
                rows += f"<ETag>&quot;{tag}&quot;</ETag><Size>{len(data)}</Size></Contents>"
        head = f"<Name>{bucket}</Name><Prefix>{escape(prefix)}</Prefix><IsTruncated>false</IsTruncated>"
        self._answer(200, f"<ListBucketResult>{head}{rows}</ListBucketResult>".encode())

    def do_GET(self) -> None:
        url = urllib.parse.urlsplit(self.path)
        query, path = urllib.parse.parse_qs(url.query, keep_blank_values=True), urllib.parse.unquote(url.path)
        bucket, _, key = path.lstrip("/").partition("/")
        if "location" in query:
            self._answer(200, b"<LocationConstraint></LocationConstraint>")
        elif not key:
            self._list(bucket, query)
        elif path in self.objects:
            self._answer(200, self.objects[path], hashlib.md5(self.objects[path]).hexdigest())
        else:
            self._answer(404, b"<Error><Code>NoSuchKey</Code></Error>")

    do_HEAD = do_GET

    def do_PUT(self) -> None:
        data = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        path = urllib.parse.unquote(urllib.parse.urlsplit(self.path).path)
        self.objects[path] = data
        self._answer(200, b"", hashlib.md5(data).hexdigest())


class S3Store:
    """Runs until `close()`. `objects`: what it holds, by /BUCKET/KEY."""

    def __init__(self) -> None:
        self.objects: dict[str, bytes] = {}
        handler = type("Handler", (_Handler,), {"objects": self.objects})
        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def config(self) -> str:
        """What s3cmd must know of it."""
        host = f"127.0.0.1:{self._server.server_address[1]}"
        lines = ["[default]", "access_key = test", "secret_key = test", "use_https = False"]
        return "\n".join([*lines, f"host_base = {host}", f"host_bucket = {host}", ""])

    def close(self) -> None:
        """Ends it."""
        self._server.shutdown()
        self._server.server_close()
