"""An independent reader of the OpenEXR files of docs/matte.md, to check the package against. Scan lines, 32-bit float, ZIP or
ZIPS."""

import pathlib
import struct
import zlib

import numpy as np

LINES_PER_CHUNK = {2: 1, 3: 16}  # by compression: ZIPS, ZIP


def _string(content: bytes, at: int) -> tuple[str, int]:
    end = content.index(0, at)
    return content[at:end].decode(), end + 1


def _header(content: bytes, at: int) -> tuple[dict[str, bytes], int]:
    attributes = {}
    while content[at] != 0:
        name, at = _string(content, at)
        _, at = _string(content, at)  # its type
        (size,) = struct.unpack_from("<i", content, at)
        attributes[name] = content[at + 4 : at + 4 + size]
        at += 4 + size
    return attributes, at + 1


def _channel_names(channels: bytes) -> list[str]:
    names, at = [], 0
    while channels[at] != 0:
        name, at = _string(channels, at)
        (kind,) = struct.unpack_from("<i", channels, at)
        assert kind == 2, f"{name} is not of 32-bit floats"
        names.append(name)
        at += 16
    return names


def _unpacked(packed: bytes, size: int) -> bytes:
    if len(packed) == size:
        return packed
    deltas = np.frombuffer(zlib.decompress(packed), np.uint8).astype(np.int64)
    deltas[1:] -= 128
    halves = np.cumsum(deltas).astype(np.uint8)
    content = np.empty_like(halves)
    middle = (size + 1) // 2
    content[0::2], content[1::2] = halves[:middle], halves[middle:]
    return content.tobytes()


def read_exr(path: pathlib.Path) -> dict[str, dict[str, np.ndarray]]:
    """Arrays of H x W by part ("" without parts) and channel, without the part's prefix."""
    content = path.read_bytes()
    assert content[:4] == b"\x76\x2f\x31\x01"
    multi_part = content[5] & 0x10 != 0
    header, at = _header(content, 8)
    headers = [header]
    while multi_part and content[at] != 0:
        header, at = _header(content, at)
        headers.append(header)
    at += multi_part
    parts = {}
    for header in headers:
        left, top, right, bottom = struct.unpack("<4i", header["dataWindow"])
        width, height = right - left + 1, bottom - top + 1
        names = _channel_names(header["channels"])
        planes = np.empty((height, len(names), width), np.float32)
        lines = LINES_PER_CHUNK[header["compression"][0]]
        chunk_count = -(-height // lines)
        for offset in struct.unpack_from(f"<{chunk_count}Q", content, at):
            chunk = offset + 4 * multi_part  # its part's number comes first
            line, packed_size = struct.unpack_from("<2i", content, chunk)
            rows = min(lines, bottom + 1 - line)
            packed = content[chunk + 8 : chunk + 8 + packed_size]
            values = np.frombuffer(_unpacked(packed, rows * len(names) * width * 4), "<f4")
            planes[line - top : line - top + rows] = values.reshape(rows, len(names), width)
        at += 8 * chunk_count
        part = header.get("name", b"").decode()
        parts[part] = {name.removeprefix(f"{part}."): planes[:, i] for i, name in enumerate(names)}
    return parts
