"""RPCs in GDAL's metadata domain RPC, which GDAL fills from GeoTIFF tags and all other files.

https://gdal.org/en/stable/development/rfc/rfc22_rpc.html
"""

from __future__ import annotations

from collections.abc import Mapping

from ..errors import GeoreferencingError
from ..rasters.grid import MOST_PX
from .polynomials import TERMS
from .rpc import RPC

# Names of the coefficients of the polynomials of `RPC`.
POLYNOMIALS = ("SAMP_NUM_COEFF", "SAMP_DEN_COEFF", "LINE_NUM_COEFF", "LINE_DEN_COEFF")


def rpc_from_tags(tags: Mapping[str, str], name: str) -> RPC:
    """Return the RPCs in tags.

    Parameters
    ----------
    tags
        GDAL's metadata domain RPC.
    name
        Name of the file, for errors.

    Raises
    ------
    GeoreferencingError
        Something is missing or is no number.
    """

    def number(key: str) -> float:
        return float(tags[key].split()[0])  # a unit may follow

    def error_m(key: str) -> float | None:
        # GDAL writes -1 for an unknown error.
        return None if not tags.get(key) or number(key) < 0 else number(key)

    try:
        rpc = RPC(
            (number("LONG_OFF"), number("LAT_OFF"), number("HEIGHT_OFF")),
            (number("LONG_SCALE"), number("LAT_SCALE"), number("HEIGHT_SCALE")),
            (number("SAMP_OFF"), number("LINE_OFF")),
            (number("SAMP_SCALE"), number("LINE_SCALE")),
            tuple(_coefficients(tags, key) for key in POLYNOMIALS),
            error_m("ERR_BIAS"),
            error_m("ERR_RAND"),
        )
        _require_earthly(rpc)
        return rpc
    except KeyError as error:
        raise GeoreferencingError(f"the RPCs of {name} lack {error.args[0]}") from error
    except (ValueError, IndexError) as error:
        raise GeoreferencingError(f"the RPCs of {name} cannot be understood: {error}") from error


def _require_earthly(rpc: RPC) -> None:
    """Raise ValueError for RPCs that belong to no image of the Earth.

    Offsets and scales are bounded by the extent of the Earth, the height of its atmosphere, and the
    largest side that GDAL allows, in pixels.
    """
    for name, largest, numbers in (
        ("longitude", 360.0, (rpc.offset[0], rpc.scale[0])),
        ("latitude", 90.0, (rpc.offset[1], rpc.scale[1])),
        ("height", 1e5, (rpc.offset[2], rpc.scale[2])),
        ("pixel", MOST_PX, (*rpc.image_offset, *rpc.image_scale)),
    ):
        if max(map(abs, numbers)) > largest:
            raise ValueError(f"{max(numbers, key=abs):g} is the {name} of no image")
    if not rpc.is_regular:
        raise ValueError("a denominator vanishes, or all the ground has one place in the image")


def rpc_to_tags(rpc: RPC) -> dict[str, str]:
    """Return RPCs as GDAL's metadata domain RPC, with all digits."""
    longitude, latitude, height = zip(rpc.offset, rpc.scale, strict=True)
    sample, line = zip(rpc.image_offset, rpc.image_scale, strict=True)
    named = {"LINE": line, "SAMP": sample, "LAT": latitude, "LONG": longitude, "HEIGHT": height}
    polynomials = dict(zip(POLYNOMIALS, rpc.polynomials, strict=True))
    lines_first = POLYNOMIALS[2:] + POLYNOMIALS[:2]
    errors = {"ERR_BIAS": rpc.error_bias_m, "ERR_RAND": rpc.error_random_m}
    return (
        {name: _text(-1.0 if error is None else error) for name, error in errors.items()}
        | {f"{name}_OFF": _text(offset) for name, (offset, _) in named.items()}
        | {f"{name}_SCALE": _text(scale) for name, (_, scale) in named.items()}
        | {name: " ".join(map(_text, polynomials[name])) for name in lines_first}
    )


def _coefficients(tags: Mapping[str, str], key: str) -> tuple[float, ...]:
    values = tuple(float(word) for word in tags[key].replace(",", " ").split())
    if len(values) != TERMS:
        raise ValueError(f"{key} has {len(values)} coefficients, not {TERMS}")
    return values


def _text(number: float) -> str:
    return f"{number:.17g}"
