"""Groups of pictures that look alike, by perceptual hash."""

from collections.abc import Mapping

import numpy as np
from PIL import Image

__all__ = ["LOOK_ALIKE_BITS", "look_alikes", "perceptual_hash"]

LOOK_ALIKE_BITS = 8
"""Perceptual hashes (64 bits) that differ in at most so many bits belong to look-alikes."""


def look_alikes(hashes: Mapping[str, str]) -> list[tuple[str, ...]]:
    """Groups of two or more ids whose pictures look alike, directly or through others.

    Args:
        hashes: perceptual hash of each id, as hex digits.
    """
    ids = list(hashes)
    bits = np.array([int(hashes[i], 16) for i in ids], np.uint64)
    group_of = np.arange(len(ids))
    for later in range(len(ids)):
        alike = np.bitwise_count(bits[:later] ^ bits[later]) <= LOOK_ALIKE_BITS
        joined = np.unique(group_of[:later][alike])
        if len(joined):
            group_of[later] = joined[0]
            group_of[np.isin(group_of, joined)] = joined[0]
    groups: dict[int, list[str]] = {}
    for image_id, group in zip(ids, group_of.tolist(), strict=True):
        groups.setdefault(group, []).append(image_id)
    return [tuple(group) for group in groups.values() if len(group) > 1]


def perceptual_hash(pixels: Image.Image) -> str:
    """64 bits as 16 hex digits; pictures that look alike differ in few of them."""
    import imagehash

    return str(imagehash.phash(pixels))
