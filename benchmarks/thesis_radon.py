"""[Patel2017], tables 3.3 and 3.4: results of its Radon method, without and with noise."""

from __future__ import annotations

from dataclasses import dataclass

Triple = tuple[float, float, float]

# Rotation in degrees and shift (x, y) in pixels that P applied to every image.
ACTUAL: tuple[Triple, ...] = ((0, 20, 35), (20, 5, 17), (10, 35, 17), (25, 14, 30))

# Columns and rows of P's images.
SIZES = {
    "image-1": (489, 300),
    "image-2": (579, 481),
    "image-3": (3264, 2448),
    "image-4": (256, 256),
}


@dataclass(frozen=True)
class Estimates:
    """P's estimates for an image, in the order of `ACTUAL`; noise on grey values 0 to 1."""

    image: str
    noise_variance: float
    found: tuple[Triple, Triple, Triple, Triple]

    def errors(self) -> list[Triple]:
        """Return the absolute errors of rotation in degrees and shift (x, y) in pixels."""
        return [
            (abs(f[0] - a[0]), abs(f[1] - a[1]), abs(f[2] - a[2]))
            for f, a in zip(self.found, ACTUAL, strict=True)
        ]


ESTIMATES = (
    Estimates("image-1", 0.0, ((0.5, 20, 27), (18.5, 7, 15), (10.5, 34, 17), (23.5, 15, 19))),
    Estimates("image-2", 0.0, ((0.5, 20, 35), (20, 4, 18), (10, 35, 18), (25, 14, 31))),
    Estimates("image-3", 0.0, ((0.5, 16, 37), (20.5, 6, 20), (10.5, 13, 18), (25.5, 15, 33))),
    Estimates("image-4", 0.0, ((0.5, 20, 35), (18, 5, 16), (9.5, 34, 17), (24, 13, 29))),
    Estimates("image-1", 0.001, ((0.5, 20, 27), (18, 7, 15), (10.5, 34, 17), (23.5, 15, 19))),
    Estimates("image-2", 0.001, ((0.5, 20, 35), (20, 4, 18), (10, 35, 18), (25, 14, 31))),
    Estimates("image-1", 0.005, ((0.5, 20, 26), (18, 7, 14), (10.5, 34, 17), (23.5, 15, 18))),
    Estimates("image-2", 0.005, ((0.5, 20, 35), (20, 4, 18), (10, 35, 18), (25, 14, 31))),
)
