"""Files as accidents leave them: flipped, cut, spliced, zeroed, swapped, of another kind."""

import io
import json
import random
import zipfile

_HUGE = (b"\xff" * 8, b"\xff" * 7 + b"\x7f", (2**40).to_bytes(8, "little"), b"\xff" * 4 + bytes(4))


def _zip():
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as file:
        file.writestr("a", "b")
    return packed.getvalue()


FOREIGN = (
    b"",
    b"\x00" * 4096,
    b"hello\n",
    b"\x89HDF\r\n\x1a\n" + bytes(200),
    b"CDF\x01" + b"\xff" * 60,
    b"CDF\x05" + (2**60).to_bytes(8, "big") * 20,
    b"\x89PNG\r\n\x1a\n" + bytes(100),
    b"\x7fELF" + bytes(100),
    b"\x80\x04\x95" + bytes(40),
    b"\x93NUMPY\x01\x00" + bytes(100),
    json.dumps({"run": {"t_end": 1e400}}).encode(),
    "[run]\nt_end = 1.0 # ÷ﷺ\u202e\n".encode(),
    _zip(),
)
"""Whole files of other kinds, some of which begin like one of ours."""


def _flip(content, chance):
    for _ in range(chance.choice((1, 1, 1, 2, 8, 40))):
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)


def _cut(content, chance):
    del content[chance.randrange(len(content)) :]


def _zero(content, chance):
    start = chance.randrange(len(content))
    stop = min(len(content), start + chance.choice((1, 8, 64, 512, 4096)))
    content[start:stop] = bytes(stop - start)


def _swap(content, chance):
    middle = chance.randrange(len(content))
    content[:] = content[middle:] + content[:middle]


def _splice(content, chance):
    to, start = chance.randrange(len(content)), chance.randrange(len(content))
    content[to:to] = content[start : start + chance.randrange(1, 512)]


def _copy(content, chance):
    to, start = chance.randrange(len(content)), chance.randrange(len(content))
    part = content[start : start + chance.randrange(1, 512)]
    content[to : to + len(part)] = part


def _huge(content, chance):
    """Where there is a size, it becomes a huge one."""
    place = chance.randrange(len(content))
    content[place : place + 8] = chance.choice(_HUGE)


KINDS = (_flip, _cut, _zero, _swap, _splice, _copy, _huge)


def mutated(whole, chance=None):
    """Return other bytes than the given ones.

    Parameters
    ----------
    whole : bytes
        Of a good file.
    chance : random.Random, optional
        Decides.
    """
    chance = chance or random.Random()
    while True:
        if chance.random() < 0.03:
            return chance.choice(FOREIGN)
        content = bytearray(whole)
        for _ in range(chance.choice((1, 1, 1, 2))):
            if content:
                chance.choice(KINDS)(content, chance)
        if bytes(content) != whole:
            return bytes(content)
