"""Reading a picture safely, telling pictures apart, and showing them small."""

from vqa_state.images.hashes import content_hash, pixel_hash, shown, thumbnail
from vqa_state.images.limits import MAX_BYTES, MAX_MEMORY, MAX_PIXELS, MIN_SIDE, Kind
from vqa_state.images.near_duplicates import perceptual_hash
from vqa_state.images.reading import (
    Picture,
    check_side,
    read_file,
    read_picture,
    reading,
    rgb_pixels,
)

__all__ = [
    "MAX_BYTES",
    "MAX_MEMORY",
    "MAX_PIXELS",
    "MIN_SIDE",
    "Kind",
    "Picture",
    "check_side",
    "content_hash",
    "perceptual_hash",
    "pixel_hash",
    "read_file",
    "read_picture",
    "reading",
    "rgb_pixels",
    "shown",
    "thumbnail",
]
