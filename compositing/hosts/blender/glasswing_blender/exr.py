"""OpenEXR files of scan lines: float or half, uncompressed or deflated (ZIPS, ZIP), one part or several.

That is what a matte's file is (docs/matte.md), and what Blender writes for this add-on. Blender 3.4's own Python has
neither OpenEXR nor OpenImageIO, and only the compositor reads files of several parts.
"""

import struct
import zlib

import numpy as np

_MAGIC = 20000630
_MULTIPART = 0x1000
_TYPES = {1: np.dtype("<f2"), 2: np.dtype("<f4")}
_LINES = {0: 1, 2: 1, 3: 16}  # of a chunk, by compression


class NotAnExr(ValueError):
    """The file is damaged, or a kind of OpenEXR that is not supported here."""


class _Bytes:
    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, count):
        if self.at + count > len(self.data):
            raise NotAnExr("the file is truncated")
        self.at += count
        return self.data[self.at - count : self.at]

    def word(self):
        end = self.data.find(b"\0", self.at, self.at + 256)
        if end < 0:
            raise NotAnExr("a name in the header is not terminated")
        text = self.data[self.at : end].decode()
        self.at = end + 1
        return text

    def int32(self):
        return struct.unpack("<i", self.take(4))[0]


class Part:
    """One part: `name`, `text` (its attributes of type string), and its picture's position and channels."""

    def __init__(self, attributes):
        try:
            self.left, self.top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
            self.compression, channels = attributes["compression"][0], attributes["channels"]
        except KeyError as error:
            raise NotAnExr(f"the header has no {error.args[0]}") from None
        self.width, self.height = right - self.left + 1, bottom - self.top + 1
        self.text = {name: value.decode(errors="replace") for name, value in attributes.items() if name not in _BINARY}
        self.name = self.text.get("name", "")
        if self.compression not in _LINES:
            raise NotAnExr(f"compression {self.compression} is not read; none, ZIPS and ZIP are")
        if not (0 < self.width <= 65536 and 0 < self.height <= 65536):
            raise NotAnExr(f"a picture of {self.width}x{self.height} pixels")
        self.channels = []  # (name, type), as they follow each other in a line
        reader = _Bytes(channels)
        while name := reader.word():
            kind = reader.int32()
            reader.take(12)
            if kind not in _TYPES:
                raise NotAnExr(f"channel {name} has type {kind}; half and float are read")
            self.channels.append((name, _TYPES[kind]))
        self.line_bytes = self.width * sum(kind.itemsize for _, kind in self.channels)
        self.chunk_lines = _LINES[self.compression]
        self.chunk_count = -(-self.height // self.chunk_lines)

    def planes(self, lines):
        """{channel: (height, width) float32} of all lines' bytes, an array of (height, line_bytes)."""
        planes, at = {}, 0
        for name, kind in self.channels:
            end = at + self.width * kind.itemsize
            planes[name] = np.ascontiguousarray(lines[:, at:end]).view(kind).astype(np.float32, copy=False)
            at = end
        return planes


_BINARY = ("channels", "compression", "dataWindow", "displayWindow", "lineOrder", "chromaticities")


def _header(reader):
    attributes = {}
    while name := reader.word():
        reader.word()  # its type
        attributes[name] = reader.take(reader.int32())
    return attributes


def _unpacked(packed, part, rows):
    """(rows, line_bytes) uint8 of a chunk. Deflated bytes are differences of the even bytes, then of the odd ones."""
    size = rows * part.line_bytes
    if part.compression == 0 or len(packed) == size:
        raw = np.frombuffer(packed, np.uint8)
    else:
        try:
            raw = np.frombuffer(zlib.decompress(packed), np.uint8)
        except zlib.error as error:
            raise NotAnExr(f"lines cannot be unpacked: {error}") from None
        if len(raw) == size:
            summed = np.cumsum(raw, dtype=np.uint8)
            summed[1::2] ^= 128  # each difference is 128 too large
            raw = np.empty(size, np.uint8)
            half = (size + 1) // 2
            raw[0::2], raw[1::2] = summed[:half], summed[half:]
    if len(raw) != size:
        raise NotAnExr(f"lines have {len(raw)} bytes; they must have {size}")
    return raw.reshape(rows, part.line_bytes)


def read_parts(path, wanted=lambda name: True, each_line=None):
    """[(Part, {channel: (height, width) float32})] for the parts whose name is wanted; for the others, {}.

    `each_line`: {name of a part that is not wanted: called with each of its lines' row and its float32 numbers}."""
    with open(path, "rb") as file:
        reader = _Bytes(file.read())
    magic, version = struct.unpack("<Ii", reader.take(8))
    if magic != _MAGIC:
        raise NotAnExr(f"{path} is not an OpenEXR file")
    multipart = bool(version & _MULTIPART)
    parts = [Part(_header(reader))]
    while multipart and (attributes := _header(reader)):
        parts.append(Part(attributes))
    chunks = sum(part.chunk_count for part in parts)
    if version & 0xA00 or any(part.text.get("type", "scanlineimage") != "scanlineimage" for part in parts):
        raise NotAnExr(f"{path} has tiles or deep pixels, which are not supported")
    reader.take(8 * chunks)  # where each begins: they are read in the file's order
    lines = [np.zeros((part.height, part.line_bytes), np.uint8) if wanted(part.name) else None for part in parts]
    for _ in range(chunks):
        number = reader.int32() if multipart else 0
        line, size = reader.int32(), reader.int32()
        packed = reader.take(size)
        if not 0 <= number < len(parts):
            raise NotAnExr(f"lines of part {number}, of {len(parts)}")
        part = parts[number]
        each = (each_line or {}).get(part.name)
        if lines[number] is None and each is None:
            continue
        first = line - part.top
        if not 0 <= first < part.height:
            raise NotAnExr(f"line {line} is not in the picture")
        rows = min(part.chunk_lines, part.height - first)
        if lines[number] is None:
            for row, raw in enumerate(_unpacked(packed, part, rows), first):
                each(row, raw.view("<f4"))
            continue
        lines[number][first : first + rows] = _unpacked(packed, part, rows)
    return [(part, {} if data is None else part.planes(data)) for part, data in zip(parts, lines)]
