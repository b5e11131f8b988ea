"""The file that opens the viewer: it is its owner's alone, and no argument of a program has the token."""

import os
import re
import signal
import subprocess
import sys
from time import monotonic, sleep

import pytest

from texgs.core.errors import ArgumentError
from texgs.viewer.guard import entry

WAIT = 60  # seconds, on a busy machine


def test_each_run_has_its_token_in_a_file_that_only_its_owner_reads(tmp_path):
    path, addresses = tmp_path / "new" / "viewer.html", set()
    for _ in range(2):
        with entry(path, "http://localhost:1") as address:
            assert path.stat().st_mode & 0o777 == 0o600
            assert f'url={address}"' in path.read_text()
        assert not path.exists()
        assert re.fullmatch(r"http://localhost:1/[\w-]{43}/", address)
        addresses.add(address)
    assert len(addresses) == 2


def test_a_run_takes_over_the_token_of_one_that_was_killed_unless_others_may_have_it(tmp_path):
    path, root = tmp_path / "viewer.html", "http://localhost:1"
    with entry(path, root) as killed, entry(path, root) as again:
        assert again == killed
        path.chmod(0o644)
        with entry(path, root) as other:
            assert other != killed
            path.write_bytes(b"\xff damaged")
            with entry(path, root) as last:
                assert last not in (killed, other)


def test_a_folder_that_cannot_be_written_is_told(tmp_path):
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(ArgumentError, match=r"cannot write there .*; set TEXGS_CACHE"),
        entry(tmp_path / "file" / "viewer.html", "http://localhost:1"),
    ):
        pass


def test_the_browser_gets_a_file_and_no_token(scene_file, tmp_path):
    """All users of a machine see the arguments of programs."""
    browser = tmp_path / "browser"
    browser.write_text(
        '#!/bin/sh\necho "$@" > "$0.part"\ncat "${1#file://}" > "$0.page"\nmv "$0.part" "$0.seen"\n'
    )
    browser.chmod(0o755)
    words = [sys.executable, "-m", "texgs.cli.main", "view", str(scene_file), "--port", "0"]
    env = {**os.environ, "TEXGS_CACHE": str(tmp_path / "cache"), "BROWSER": f"{browser} %s"}
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=env)
    try:
        address, end = process.stdout.readline().strip(), monotonic() + WAIT
        while not (seen := browser.with_suffix(".seen")).exists() and monotonic() < end:
            sleep(0.05)
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=WAIT)
    assert address.split("/")[-2] not in seen.read_text()
    assert address in browser.with_suffix(".page").read_text()
