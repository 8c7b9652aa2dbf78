"""Pictures for the vehicles of tests/netns/insider_lab.py."""

import os
import struct
import zlib

# The number of the picture of make_streets() in which the busy street is empty.
FRAME_WITHOUT_WALKERS = 0


def write_png(path, width, height, rows):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) +
                   chunk(b"IDAT", zlib.compress(b"".join(b"\0" + bytes(row) for row in rows), 1)) + chunk(b"IEND", b""))


def make_streets(folder):
    """Two folders of pictures that vehicles see over and over: 17 of a street with walkers and 7 of an empty one, so that
    the numbers of their pictures are the same now and then, whenever the vehicles begin. The first of the busy street shows
    nobody: who stands in the first picture that a background is learnt from is part of it for as long as he stands there
    again in every seventeenth."""
    width, height, frames, walkers = 768, 576, 16, 5
    busy, empty = os.path.join(folder, "busy"), os.path.join(folder, "empty")
    background = [bytes([90 + y // 8, 110 + y // 10, 100]) * width for y in range(height)]
    for path in (busy, empty):
        os.makedirs(path)
    for frame in range(7):
        write_png(os.path.join(empty, f"{frame}.png"), width, height, background)
    write_png(os.path.join(busy, f"{FRAME_WITHOUT_WALKERS:02}.png"), width, height, background)
    for frame in range(frames):
        rows = [bytearray(row) for row in background]
        for walker in range(walkers):
            # 30 x 70 pixels, as far apart in time that nobody stands where the same one stood before.
            x, y = 20 + 44 * frame, 30 + 105 * walker
            for line in range(y, y + 70):
                rows[line][3 * x:3 * (x + 30)] = bytes([220, 40, 40 * walker]) * 30
        write_png(os.path.join(busy, f"{frame + 1:02}.png"), width, height, rows)
    return busy, empty
