"""A server of HTTP in a thread."""

from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread


@contextmanager
def served(handler):
    """Serve by a handler on a free port of this machine; the value is the address."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    thread = Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/edit"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def replies(reply):
    """A handler whose replies are status, reason and body, from the body of a request."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            status, reason, body = reply(self.rfile.read(int(self.headers["Content-Length"])))
            self.send_response(status, reason)
            self.end_headers()
            with suppress(BrokenPipeError):  # nobody waits any more
                self.wfile.write(body)

        def log_message(self, *words):
            pass

    return Handler
