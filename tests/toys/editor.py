"""A toy of an editor: a server that inverts colours, where a real one asks a model."""

import base64
import io
import json
from http.server import BaseHTTPRequestHandler, HTTPServer

from PIL import Image, ImageOps


class Editor(BaseHTTPRequestHandler):
    def do_POST(self):
        """Reply with an edited view."""
        asked = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        view = Image.open(io.BytesIO(base64.b64decode(asked["image"])))
        ImageOps.invert(view).save(file := io.BytesIO(), "PNG")
        self.send_response(200)
        self.end_headers()
        self.wfile.write(json.dumps({"image": base64.b64encode(file.getvalue()).decode()}).encode())


if __name__ == "__main__":
    HTTPServer(("127.0.0.1", 8000), Editor).serve_forever()
