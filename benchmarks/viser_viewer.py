"""A viewer of a scene by viser, with the frames of texgs: what `texgs view` is compared with.

`python -m benchmarks.viser_viewer SCENE PORT` needs viser in the environment of texgs (`pip install viser`,
which asks for an older `rich`). It does what viser's own examples of rendered scenes do: the newest camera of
a client is rendered and becomes the background of its page.
"""

from __future__ import annotations

import threading

import torch
import viser

from benchmarks.command import call
from texgs.core.camera import Camera, intrinsics
from texgs.core.rotation import quats_to_matrices
from texgs.scene.session import Session

SIZE = 800  # pixels of either side, as of the page of texgs


def main(source: str, port: str) -> None:
    """Serve until somebody ends it."""
    session = Session.open(source)
    server = viser.ViserServer(host="127.0.0.1", port=int(port), verbose=False)
    server.scene.set_up_direction("+y")
    wanted: dict[int, viser.ClientHandle] = {}
    changed = threading.Event()

    @server.on_client_connect
    def _(client: viser.ClientHandle) -> None:
        client.camera.position, client.camera.look_at = (2.0, 1.4, 3.2), (0.0, 0.0, 0.0)

        @client.camera.on_update
        def _(_: viser.CameraHandle) -> None:
            wanted[client.client_id] = client
            changed.set()

    while changed.wait():
        changed.clear()
        while wanted:
            _, client = wanted.popitem()
            picture = session.frame(camera_of(client.camera))
            client.scene.set_background_image(picture, format="jpeg", jpeg_quality=75)


def camera_of(seen: viser.CameraHandle) -> Camera:
    """The camera of a client as texgs has it."""
    R_wc = quats_to_matrices(torch.tensor(seen.wxyz, dtype=torch.float32)[None])[0]
    viewmat = torch.eye(4)
    viewmat[:3, :3] = R_wc.T
    viewmat[:3, 3] = -R_wc.T @ torch.tensor(seen.position, dtype=torch.float32)
    return Camera(viewmat, intrinsics(seen.fov * 180 / torch.pi, SIZE, SIZE), SIZE, SIZE)


if __name__ == "__main__":
    call(main)
