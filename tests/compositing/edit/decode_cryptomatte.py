#!/usr/bin/env python3
"""Decodes a Cryptomatte by the specification alone: prints {name: [shares by rows]} of FILE as JSON.

It shares no code with what writes such files; the OpenEXR reader is that of Blender's add-on.
"""

import json
import pathlib
import struct
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "compositing" / "hosts" / "blender" / "glasswing_blender"))
import exr  # noqa: E402


def murmur3(data):
    """x86, 32 bits, seed 0."""
    mask, state = 0xFFFFFFFF, 0
    padded = data + b"\0" * (-len(data) % 4)
    for at in range(0, len(padded), 4):
        word = struct.unpack_from("<I", padded, at)[0] * 0xCC9E2D51 & mask
        word = (word << 15 | word >> 17) & mask
        state ^= word * 0x1B873593 & mask
        if at + 4 <= len(data):
            state = ((state << 13 | state >> 19) & mask) * 5 + 0xE6546B64 & mask
    state ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35), (16, 1)):
        state = (state ^ state >> shift) * factor & mask
    return state


def id_of(name):
    bits = murmur3(name.encode())
    return bits ^ (1 << 23) if bits >> 23 & 255 in (0, 255) else bits


def shares_in(path):
    parts = exr.read_parts(path)
    part, planes = parts[-1]  # the only one, or the last of a delivery file
    assert all(key in parts[0][0].text for key in part.text if key.startswith("cryptomatte/"))
    keys = {key.split("/")[2]: value for key, value in part.text.items() if key.startswith("cryptomatte/")}
    (stem,) = {key.split("/")[1] for key in part.text if key.startswith("cryptomatte/")}
    assert keys["hash"] == "MurmurHash3_32" and keys["conversion"] == "uint32_to_float32", keys
    assert stem == f"{murmur3(keys['name'].encode()):08x}"[:7], stem
    layers = sorted({name.split(".")[0] for name in planes if name.startswith(keys["name"])})
    pairs = [(f"{layer}.{ids}", f"{layer}.{covers}") for layer in layers for ids, covers in ("RG", "BA")]
    for (_, larger), (_, smaller) in zip(pairs, pairs[1:]):
        assert (planes[larger] >= planes[smaller]).all(), larger
    shares = {}
    for name, digits in json.loads(keys["manifest"]).items():
        assert int(digits, 16) == id_of(name), name
        bits = id_of(name)
        shares[name] = sum(np.where(planes[ids].view(np.uint32) == bits, planes[covers], 0) for ids, covers in pairs)
    known = {id_of(name) for name in shares} | {0}
    assert all(set(np.unique(planes[ids].view(np.uint32))) <= known for ids, _ in pairs)
    return shares


if __name__ == "__main__":
    print(json.dumps({name: share.ravel().tolist() for name, share in shares_in(sys.argv[1]).items()}))
