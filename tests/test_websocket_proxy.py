"""The proxy of the viewer's benchmark counts whole messages, however the bytes arrive."""

from hypothesis import given
from hypothesis import strategies as st

from benchmarks.websocket_proxy import Messages

UPGRADED = b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n\r\n"
PLAIN = b"HTTP/1.1 200 OK\r\nContent-Length: 4\r\n\r\n\x82\x02ab"
PING = b"\x89\x00"


def frame(size, code=2, is_last=True):
    """A frame of a server (RFC 6455, section 5.2)."""
    head = bytes([(128 if is_last else 0) | code])
    if size < 126:
        return head + bytes([size]) + bytes(size)
    return head + (bytes([126]) + size.to_bytes(2, "big") if size < 65536 else long(size)) + bytes(size)


def long(size):
    return bytes([127]) + size.to_bytes(8, "big")


def sizes(stream, cuts):
    noted = []
    messages = Messages(noted.append)
    places = sorted(cut % (len(stream) + 1) for cut in cuts)
    for start, end in zip([0, *places], [*places, len(stream)], strict=True):
        messages.feed(stream[start:end])
    return noted


@given(
    parts=st.lists(st.lists(st.sampled_from([0, 3, 125, 126, 70_000]), min_size=1, max_size=3), max_size=4),
    cuts=st.lists(st.integers(0, 10**6), max_size=8),
)
def test_messages_have_the_size_of_all_their_frames(parts, cuts):
    stream = UPGRADED
    for pieces in parts:
        for number, size in enumerate(pieces):
            stream += frame(size, 2 if number == 0 else 0, number == len(pieces) - 1) + PING
    assert sizes(stream, cuts) == [sum(pieces) for pieces in parts]


def test_other_answers_have_no_messages():
    assert sizes(PLAIN, [3, 20]) == []
