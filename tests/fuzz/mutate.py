"""Seeded damage to the bytes of a file: what disks, networks and ill-meaning people do to it."""

import random
import re
from collections.abc import Callable

Damage = Callable[[bytearray, random.Random], bytes]

# What a number of a header is replaced by.
NUMBERS = (
    *(b"0", b"-1", b"1", b"2147483648", b"99999999999", b"18446744073709551615", b"1e999", b"nan", b"-inf"),
    *(b"9" * 400, b"9" * 5000, b"", b"0x7f", b"1e-320"),
)
# What is put in the middle of a text.
WORDS = (
    *(b"../../../../etc/passwd", b"\x1b[2J\x07", b"\x00", b"$x_{$", b"${oc.env:HOME}", b"\xff\xfe", b"%d"),
    *(b"\n", b"[" * 20000, b'{"a":' * 20000, b"<a>" * 2000, b"'" * 3, b"!!python/object:os.system"),
    *(b"*a", b"&a [*a, *a]", "\N{RIGHT-TO-LEFT OVERRIDE}\N{PILE OF POO}".encode(), b"/dev/zero"),
    *(b"2001-99-99", b"null", b"A" * 5000),
)
# What a binary number is replaced by.
SIZES = (0, 1, 0x7F, 0x80, 0xFF, 0xFFFF, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**63, 2**64 - 1)


def mutated(data: bytes, random: random.Random) -> bytes:
    """The bytes with one to three kinds of damage; the same for the same state of `random`."""
    for _ in range(random.choice((1, 1, 2, 3))):
        data = random.choice(DAMAGES)(bytearray(data or b"\x00"), random)
    return data


def place(data: bytearray, random: random.Random) -> int:
    """An index; half of them at the start, where headers are."""
    most = len(data) if random.random() < 0.5 else min(len(data), 400)
    return random.randrange(most)


def flip(data: bytearray, random: random.Random) -> bytes:
    for _ in range(random.choice((1, 1, 3, 20))):
        data[place(data, random)] ^= 1 << random.randrange(8)
    return bytes(data)


def overwrite(data: bytearray, random: random.Random) -> bytes:
    at, count = place(data, random), random.choice((1, 4, 64))
    data[at : at + count] = random.choice((random.randbytes(count), b"\x00" * count, b"\xff" * count))
    return bytes(data)


def cut(data: bytearray, random: random.Random) -> bytes:
    return bytes(data[: place(data, random)])


def remove(data: bytearray, random: random.Random) -> bytes:
    at = place(data, random)
    del data[at : at + random.choice((1, 4, 100))]
    return bytes(data)


def repeat(data: bytearray, random: random.Random) -> bytes:
    at, count = place(data, random), random.choice((1, 16, 400))
    return bytes(data[:at] + data[at : at + count] * random.choice((2, 3, 50)) + data[at:])


def number(data: bytearray, random: random.Random) -> bytes:
    """One number of a text is another one."""
    matches = list(re.finditer(rb"-?\d+(\.\d+)?", bytes(data[:4000])))
    if not matches:
        return size(data, random)
    at = random.choice(matches)
    return bytes(data[: at.start()] + random.choice(NUMBERS) + data[at.end() :])


def word(data: bytearray, random: random.Random) -> bytes:
    """One word of a text is something else."""
    matches = list(re.finditer(rb"[A-Za-z_.]{2,}", bytes(data[:4000]))) or [re.match(b"", b"")]
    at = random.choice(matches)
    return bytes(data[: at.start()] + random.choice(WORDS) + data[at.end() :])


def swap(data: bytearray, random: random.Random) -> bytes:
    """One word of a text is another word of it."""
    matches = list(re.finditer(rb"[A-Za-z0-9_.]{2,}", bytes(data[:4000]))) or [re.match(b"", b"")]
    at, other = random.choice(matches), random.choice(matches)
    return bytes(data[: at.start()] + other.group() + data[at.end() :])


def size(data: bytearray, random: random.Random) -> bytes:
    """One binary number is an extreme one, in either byte order."""
    width = random.choice((2, 4, 8))
    at = place(data, random)
    order = random.choice(("little", "big"))
    data[at : at + width] = (random.choice(SIZES) % 2 ** (8 * width)).to_bytes(width, order)
    return bytes(data)


DAMAGES: tuple[Damage, ...] = (flip, overwrite, cut, remove, repeat, number, number, word, swap, size, size)
