import hashlib
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest

from texgs.core.errors import ArgumentError
from texgs.volume.download import download, require_whole

DATA = b"a volume"
SHA256 = hashlib.sha256(DATA).hexdigest()


@pytest.fixture
def address(tmp_path):
    """Of a folder that holds a file, as long as the test runs."""
    folder = tmp_path / "served"
    folder.mkdir()
    (folder / "a.raw").write_bytes(DATA)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(SimpleHTTPRequestHandler, directory=folder))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/a.raw"
    server.shutdown()
    server.server_close()
    thread.join()


def test_a_file_is_downloaded_once_and_this_is_said(address, tmp_path, capsys):
    path = tmp_path / "cache" / "a.raw"
    download(address, SHA256, path)
    assert path.read_bytes() == DATA
    assert f"{path}: downloading it from {address}\n" in capsys.readouterr().err
    download("http://127.0.0.1:9/nobody-listens", SHA256, path)
    assert not capsys.readouterr().err
    require_whole(path, SHA256)
    path.write_bytes(b"A volume")
    with pytest.raises(ArgumentError, match=r"a\.raw: expected the checksum .* delete it"):
        require_whole(path, SHA256)


def test_an_address_has_a_scheme_and_a_checksum_any_case(address, tmp_path):
    download(address, SHA256.upper(), tmp_path / "a.raw")
    require_whole(tmp_path / "a.raw", SHA256.upper())
    with pytest.raises(ArgumentError, match="expected an address that begins with https:// or http://"):
        download(address.replace("http://", "htp://"), SHA256, tmp_path / "b.raw")


def test_another_file_or_none_is_one_sentence_and_keeps_nothing(address, tmp_path):
    path = tmp_path / "cache" / "a.raw"
    with pytest.raises(ArgumentError, match="got another file"):
        download(address, "0" * 64, path)
    for nothing in (f"{address}.not-there", "https:///a.raw"):
        with pytest.raises(ArgumentError, match=f"{nothing}: cannot be downloaded"):
            download(nothing, SHA256, path)
    assert not path.exists()
