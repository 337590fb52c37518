"""Prepare windows for spectral methods: apodise, resample by a pose, crop to the shared part.

`benchmarks/run.py --only rotation` measures the effect of the constants of these methods.
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

# Images are tapered towards their borders and masked pixels over this share of their shorter side.
_FADING_SHARE = 0.15

# Two poses are the same if they differ by less than all of these limits.
SAME_DEG = 3.0
SAME_LOG_SCALE = 0.05
SAME_PX = 6.0

# Largest number of candidates that are aligned and returned, and their least height as a share of
# the best one's height.
RETURNED = 2
WORTH_ALIGNING = 0.5

# A resampled pixel is valid if the weights of valid pixels sum to more than this.
_ALL_VALID = 0.999

# Windows that share less than this part of the reference's pixels are not compared.
MINIMUM_SHARED = 0.05


def texture(window: Patch, settings: SimilaritySettings) -> Image:
    """Return the image for spectra: grey values for "ncc", otherwise their logarithm.

    The logarithm makes the speckle of a SAR image additive and keeps its brightest points from
    dominating the spectrum.
    """
    if settings.similarity != "ncc":
        return compress(window)
    return np.where(window.valid, window.values, _mean(window))


def _mean(window: Patch) -> np.float32:
    return np.float32(window.values[window.valid].mean()) if window.valid.any() else np.float32(0)


def structure(window: Patch, settings: SimilaritySettings) -> Image | Field:
    """Return the apodised image to correlate: grey values for "ncc", else the orientation field.

    SAR and optical images have the orientation field (see `orientation`) in common.
    """
    image = texture(window, settings)
    if settings.similarity == "ncc":
        return apodise(image, window.valid)
    return apodise(squared_gradients(image, window.valid, SCALES_PX[1:2])[0], window.valid)


def apodise(image: AnyImage, valid: NDArray[np.bool_], disc: bool = False) -> AnyImage:
    """Return an image without its mean, tapered towards its borders and masked pixels.

    Parameters
    ----------
    image, valid
        Grey values or a complex field, and the mask of valid pixels, shape (h, w).
    disc
        Whether to keep only the disc inside the borders, whose outline is rotation-invariant.
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
    """Return the input resampled into the reference: rotated, scaled and shifted back.

    Parameters
    ----------
    input
        The window.
    pose
        Pose of the input relative to the reference.
    shape
        Rows and columns of the result, which is centred on the reference.
    kernel
        "bilinear" or "cubic".
    """
    to_input = pose.between(shape, input.values.shape)
    rows, cols = np.indices(shape, float)
    px = np.stack([x * cols + y * rows + start for x, y, start in (to_input[:3], to_input[3:6])])
    fill = _mean(input)
    values = np.where(input.valid, input.values - fill, np.float32(0))
    if pose.scale > 1:
        # The input is finer: smooth away the detail that the result's pixels cannot resolve.
        values[...] = cv2.GaussianBlur(values, (0, 0), 0.5 * np.sqrt(pose.scale**2 - 1) + 1e-3)
    valid = interpolate(input.valid.astype(np.float32), px, "bilinear") > _ALL_VALID
    return Patch(interpolate(values, px, kernel) + fill, valid)


def covering_shape(
    input: tuple[int, int], pose: Pose, reference: tuple[int, int]
) -> tuple[int, int]:
    """Return the rows and columns that hold a whole input, given by its shape, resampled by a pose.

    Their parity is that of the reference, so that the pixels of both coincide.
    """
    inverse = np.abs(np.linalg.inv(pose.linear))
    width, height = np.ceil(inverse @ [input[1], input[0]]).astype(int)
    return (
        int(height + (height - reference[0]) % 2),
        int(width + (width - reference[1]) % 2),
    )


@dataclass(frozen=True)
class Shared:
    """The part of the ground that both the reference and the resampled input show.

    Parameters
    ----------
    reference, input
        Windows of one shape, in reference pixels; both have the same valid pixels.
    offset_px
        Offset (right, down) of their centre from the centre of the reference.
    """

    reference: Patch
    input: Patch
    offset_px: FloatArray


def shared(reference: Patch, input: Patch, pose: Pose) -> Shared | None:
    """Return the part that a reference and an input at a pose share; None if it is too small."""
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
    """Return a candidate corrected by the residual pose between the parts both windows show.

    Cropped to one shape and tapered alike, the parts no longer differ at their borders, where
    differences would bias an estimate towards zero shift.

    Parameters
    ----------
    reference, input
        The windows.
    found
        The candidate.
    limits
        Limits of the result.
    settings
        How similarity is measured.
    remaining
        Corrections that are applied in turn. Each returns the pose of the input's part relative
        to the reference's; None if it finds none.
    """
    for correct in remaining:
        both = shared(reference, input, found.pose)
        correction = None if both is None else correct(both, settings)
        if both is not None and correction is not None:
            pose = corrected(found.pose, correction.pose, both.offset_px)
            found = PoseFound(within(pose, limits), correction.height)
    return found


def corrected(pose: Pose, correction: Pose, offset_px: FloatArray) -> Pose:
    """Return the pose that first corrects in the reference, about a centre, then applies `pose`.

    Parameters
    ----------
    pose
        The uncorrected pose.
    correction
        Residual pose between the reference and the input resampled by `pose`.
    offset_px
        Offset (right, down) of the correction's centre from the centre of the reference.
    """
    shift = offset_px + correction.shift_px - correction.linear @ offset_px
    right, down = pose.shift_px + pose.linear @ shift
    rotation = (pose.rotation_deg + correction.rotation_deg + 180) % 360 - 180
    return Pose(rotation, pose.scale * correction.scale, (float(right), float(down)))


def within(pose: Pose, limits: SearchLimits) -> Pose:
    """Return a pose clipped to limits."""
    right, down = np.clip(pose.shift_px, -limits.radius, limits.radius)
    return Pose(
        float(np.clip(pose.rotation_deg, -limits.rotation_deg, limits.rotation_deg)),
        float(np.clip(pose.scale, *limits.scale)),
        (float(right), float(down)),
    )


def distinct(found: Iterable[PoseFound], least_share: float = 0.0) -> list[PoseFound]:
    """Return candidates, best first, without those at the same pose as a better one.

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
