"""The base of all reports: one HTML page that needs no network, and its numbers as JSON."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar

import cv2
import numpy as np
import rasterio
import scipy

from ..call_paths import check_numbers
from ..geometry.judging import TOLERANCE_PX, ce90_of_rmse
from ..kinds import REPORT_FORMAT, plain
from ..rasters.atomic import Outputs, write_json, writing
from ..runs import RUN, run_tags
from ..version import __version__
from .figures import CHECK_COLOUR, FIT_COLOUR, REJECTED_COLOUR

_TEMPLATES = Path(__file__).with_name("templates")
_COLOURS = {"fit": FIT_COLOUR, "check": CHECK_COLOUR, "rejected": REJECTED_COLOUR}


@dataclass(frozen=True, kw_only=True)
class Page:
    """A page and its numbers: subclasses name the template and give its values.

    Parameters
    ----------
    title
        Heading of the page.
    parameters
        Parameters of the tool's call; None: the default.
    seconds
        Duration.
    """

    template: ClassVar[str]
    title: str
    parameters: Mapping[str, Any]
    seconds: float

    def numbers(self) -> dict[str, Any]:
        """Return the measured values by name."""
        raise NotImplementedError

    def values(self) -> dict[str, Any]:
        """Return the template's values beyond those of all pages."""
        raise NotImplementedError

    def summary(self) -> dict[str, Any]:
        """Return the numbers as values that strict JSON can carry."""
        return dict(plain(self.numbers() | made(self.parameters, self.seconds)))

    def write(
        self,
        outputs: Outputs,
        path: Path,
        item: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        """Write the numbers, a JSON file, and then the page, an HTML file beside it.

        With the members of a STAC `item`, the JSON file is a STAC item (see `stac`).

        Raises
        ------
        OutputError
            A file cannot be written.
        """
        summary = self.summary()
        how = plain(made(self.parameters, self.seconds))
        run = run_tags().get(RUN)
        template = _environment().get_template(self.template)
        page = template.render(title=self.title, run=run, **how, **self.values())
        beside = path.with_suffix(".json")
        check_numbers(path.name, beside)
        numbers = {"format": REPORT_FORMAT, **plain(dict(item)), **summary}
        write_json(outputs.stage(beside), numbers)
        staged = outputs.stage(path)
        with writing(staged):
            staged.write_text(page, encoding="utf-8")


def made(parameters: Mapping[str, Any], seconds: float) -> dict[str, Any]:
    """Return how a result was made: the parameters that were given, versions and time."""
    given = {name: value for name, value in parameters.items() if value is not None}
    return {"parameters": given, "versions": versions(), "seconds": seconds}


def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    return {
        "groundtie": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "opencv": cv2.__version__,
        "rasterio": rasterio.__version__,
        "gdal": rasterio.__gdal_version__,
    }


@cache
def _environment() -> Any:
    """Return the renderer of pages; it keeps compiled templates for all pages of a process."""
    import jinja2  # heavy

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals.update(colours=_COLOURS, tolerance_px=TOLERANCE_PX)
    environment.filters.update(
        number=_number, percent=_percent, sentence=_sentence, ce90=ce90_of_rmse
    )
    environment.tests["finite"] = math.isfinite
    return environment


def _number(value: float | None, digits: int = 2) -> str:
    if value is None or not math.isfinite(value):
        return "–"
    # Adding 0 turns -0.0 into 0.0.
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _percent(value: float) -> str:
    return f"{value:.0%}".replace("%", " %") if math.isfinite(value) else "–"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]
