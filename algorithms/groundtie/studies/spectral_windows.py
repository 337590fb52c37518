"""Windows as spectra need them: apodised, resampled by a pose, cut to what they share.

What the constants of these methods come to, `benchmarks/run.py --only rotation` measures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry.limits import SearchLimits
from ..pose.pose import Pose, PoseFound
from ..rasters.grid import FloatArray
from ..rasters.kernels import interpolate
from ..rasters.patch import Patch
from ..similarity.orientation import SCALES_PX, compress, squared_gradients
from ..similarity.surface import SimilaritySettings

Image = NDArray[np.float32]
Field = NDArray[np.complex64]
AnyImage = TypeVar("AnyImage", Image, Field)

# Images fade out towards their borders and masked pixels over this share of their shorter side.
_FADING_SHARE = 0.15

# Poses nearer to one another than all of these are the same.
SAME_DEG = 3.0
SAME_LOG_SCALE = 0.05
SAME_PX = 6.0

# How many candidates are aligned and returned at most, and which share of the best one's height
# they have at least.
RETURNED = 2
WORTH_ALIGNING = 0.5

# Resampled pixels are valid if the weights of valid pixels sum up to this.
_ALL_VALID = 0.999

# Windows that share less than this of the reference's pixels are not compared.
MINIMUM_SHARED = 0.05


def texture(window: Patch, settings: SimilaritySettings) -> Image:
    """Return what spectra are made of: grey values for "ncc", else their logarithm.

    The logarithm makes a SAR image's speckle additive and keeps its brightest points from
    drowning all else.
    """
    if settings.similarity != "ncc":
        return compress(window)
    return np.where(window.valid, window.values, _mean(window))


def _mean(window: Patch) -> np.float32:
    return np.float32(window.values[window.valid].mean()) if window.valid.any() else np.float32(0)


def structure(window: Patch, settings: SimilaritySettings) -> Image | Field:
    """Return what is correlated, apodised: grey values for "ncc", else the orientation field.

    The field (see `orientation`) is what a SAR and an optical image have in common.
    """
    image = texture(window, settings)
    if settings.similarity == "ncc":
        return apodise(image, window.valid)
    return apodise(squared_gradients(image, window.valid, SCALES_PX[1:2])[0], window.valid)


def apodise(image: AnyImage, valid: NDArray[np.bool_], disc: bool = False) -> AnyImage:
    """Return an image without its mean, faded out towards its borders and masked pixels.

    Parameters
    ----------
    image, valid
        Grey values, or a complex field, and which of them count, shape (h, w).
    disc
        Whether only the disc inside the borders is kept, which a rotation does not change.
    """
    weights = _fading(valid)
    if disc:
        weights *= _disc((image.shape[0], image.shape[1]))
    total = float(weights.sum())
    mean = (image * weights).sum() / total if total > 0 else 0.0
    return ((image - mean) * weights).astype(image.dtype)


def _fading(valid: NDArray[np.bool_]) -> Image:
    around = np.pad(valid, 1).astype(np.uint8)
    distance = cv2.distanceTransform(around, cv2.DIST_L2, 5)[1:-1, 1:-1]
    reach = max(_FADING_SHARE * min(valid.shape), 1.0)
    return _raised_cosine(np.minimum(distance / reach, 1))


def _disc(shape: tuple[int, int]) -> Image:
    row, col = ((np.arange(n) - (n - 1) / 2) / (min(shape) / 2) for n in shape)
    return _raised_cosine(1 - np.minimum(np.hypot(row[:, None], col), 1))


def _raised_cosine(share: NDArray[np.floating]) -> Image:
    return (0.5 - 0.5 * np.cos(np.pi * share)).astype(np.float32)


def resampled(input: Patch, pose: Pose, shape: tuple[int, int], kernel: str) -> Patch:
    """Return the input as it would lie in the reference: rotated, scaled and shifted back.

    Parameters
    ----------
    input
        The window.
    pose
        How it lies against the reference.
    shape
        Rows and columns of the result, whose centre is the reference's.
    kernel
        "bilinear" or "cubic".
    """
    to_input = pose.between(shape, input.values.shape)
    rows, cols = np.indices(shape, float)
    px = np.stack([x * cols + y * rows + start for x, y, start in (to_input[:3], to_input[3:6])])
    fill = _mean(input)
    values = np.where(input.valid, input.values - fill, np.float32(0))
    if pose.scale > 1:
        # The input is finer: what the result's pixels cannot show is smoothed away.
        values[...] = cv2.GaussianBlur(values, (0, 0), 0.5 * np.sqrt(pose.scale**2 - 1) + 1e-3)
    valid = interpolate(input.valid.astype(np.float32), px, "bilinear") > _ALL_VALID
    return Patch(interpolate(values, px, kernel) + fill, valid)


def covering_shape(
    input: tuple[int, int], pose: Pose, reference: tuple[int, int]
) -> tuple[int, int]:
    """Return rows and columns that hold all of an input of a shape, resampled by a pose.

    They are even or odd as the reference's are, so that pixels fall on one another.
    """
    inverse = np.abs(np.linalg.inv(pose.linear))
    width, height = np.ceil(inverse @ [input[1], input[0]]).astype(int)
    return (
        int(height + (height - reference[0]) % 2),
        int(width + (width - reference[1]) % 2),
    )


@dataclass(frozen=True)
class Shared:
    """What reference and resampled input both show.

    Parameters
    ----------
    reference, input
        Windows of one shape, in the reference's pixels; both have the same valid pixels.
    offset_px
        How far (right, down) their centre lies from the reference's.
    """

    reference: Patch
    input: Patch
    offset_px: FloatArray


def shared(reference: Patch, input: Patch, pose: Pose) -> Shared | None:
    """Return what a reference and an input at a pose both show, None if it is too little."""
    shape = (reference.values.shape[0], reference.values.shape[1])
    back = resampled(input, pose, shape, "cubic")
    both = reference.valid & back.valid
    if both.mean() < MINIMUM_SHARED:
        return None
    rows, cols = (np.flatnonzero(both.any(axis=axis)) for axis in (1, 0))
    box = np.s_[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
    offset = np.array([cols[0] + cols[-1], rows[0] + rows[-1]]) - [shape[1] - 1, shape[0] - 1]
    valid = both[box]
    return Shared(Patch(reference.values[box], valid), Patch(back.values[box], valid), offset / 2)


def aligned(
    reference: Patch,
    input: Patch,
    found: PoseFound,
    limits: SearchLimits,
    settings: SimilaritySettings,
    *remaining: Callable[[Shared, SimilaritySettings], PoseFound | None],
) -> PoseFound:
    """Return a candidate corrected by what is left between the parts that both windows show.

    Cut to one shape and faded out alike, they no longer differ at their borders, which would
    draw an estimate towards no shift.

    Parameters
    ----------
    reference, input
        The windows.
    found
        The candidate.
    limits
        Within which the result stays.
    settings
        How similarity is measured.
    remaining
        Each corrects what those before have left: returns the pose of one part against the
        other, None if it has none.
    """
    for correct in remaining:
        both = shared(reference, input, found.pose)
        correction = None if both is None else correct(both, settings)
        if both is not None and correction is not None:
            pose = corrected(found.pose, correction.pose, both.offset_px)
            found = PoseFound(within(pose, limits), correction.height)
    return found


def corrected(pose: Pose, correction: Pose, offset_px: FloatArray) -> Pose:
    """Return the pose that first corrects in the reference, about a place, then applies `pose`.

    Parameters
    ----------
    pose
        As it was.
    correction
        What is left between the reference and the input resampled by `pose`.
    offset_px
        Where from the reference's centre the correction's own centre lies, (right, down).
    """
    shift = offset_px + correction.shift_px - correction.linear @ offset_px
    right, down = pose.shift_px + pose.linear @ shift
    rotation = (pose.rotation_deg + correction.rotation_deg + 180) % 360 - 180
    return Pose(rotation, pose.scale * correction.scale, (float(right), float(down)))


def within(pose: Pose, limits: SearchLimits) -> Pose:
    """Return the pose nearest to a pose within limits."""
    right, down = np.clip(pose.shift_px, -limits.radius, limits.radius)
    return Pose(
        float(np.clip(pose.rotation_deg, -limits.rotation_deg, limits.rotation_deg)),
        float(np.clip(pose.scale, *limits.scale)),
        (float(right), float(down)),
    )


def distinct(found: Iterable[PoseFound], least_share: float = 0.0) -> list[PoseFound]:
    """Return candidates, best first, without those that a better one stands for.

    Parameters
    ----------
    found
        Candidates in any order.
    least_share
        Candidates lower than this share of the best one's height are left out.
    """
    kept: list[PoseFound] = []
    for one in sorted(found, key=lambda candidate: -candidate.height):
        low = bool(kept) and one.height < least_share * kept[0].height
        if not low and not any(_same(one.pose, other.pose) for other in kept):
            kept.append(one)
    return kept


def _same(one: Pose, other: Pose) -> bool:
    rotated = abs((one.rotation_deg - other.rotation_deg + 180) % 360 - 180)
    scaled = abs(float(np.log(one.scale / other.scale)))
    apart = np.abs(np.subtract(one.shift_px, other.shift_px)).max()
    return bool(rotated < SAME_DEG and scaled < SAME_LOG_SCALE and apart < SAME_PX)
