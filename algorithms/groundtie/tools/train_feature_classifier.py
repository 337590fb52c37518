"""Train a classifier that keeps features on clouds, shadows or changes out of the matching."""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

from ..context import threads
from ..declaration import Output, tool
from ..errors import ParameterError
from ..features.classifier import KERNELS
from ..features.classifier_training import left_out_accuracy, train_classifier
from ..features.detectors import SiftDetector
from ..features.labels import LabelSource, labelled_points, layer_labels, raster_labels
from ..features.patch_statistics import BAND_RATIOS, STATISTICS
from ..kinds import Band, Choice, FileOut, RasterIn, Text, VectorIn
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.pair import Image
from ..rasters.reading import open_raster
from .parameters import general

# Weaker features than those that are matched are labelled, too: as many as there may be.
_CONTRAST = 0.02


@dataclass(frozen=True)
class TrainingResult:
    """The classifier, from how many points, and its accuracy at points not trained with.

    The accuracy is the mean of both classes' shares classified correctly, by classifiers without
    the blocks in which the points lie; None if the points lie too near each other.
    """

    output: Path
    kept: int
    left_out: int
    support_vectors: int
    accuracy: float | None

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {**asdict(self), "output": str(self.output)}

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        known = "unknown" if self.accuracy is None else f"{self.accuracy:.1%}"
        return [
            f"wrote {self.output}: {self.support_vectors} support vectors",
            f"trained on {self.kept} points to be kept and {self.left_out} to be left out",
            f"mean accuracy of both classes in blocks that were not seen: {known} (chance: 50 %)",
        ]


@tool(
    title="Train a feature classifier",
    group="Registration",
    outputs=(Output("ACCURACY", "Mean accuracy of both classes", "accuracy"),),
)
def train_feature_classifier(
    input: Annotated[
        Path, RasterIn(label="Image", help="The image whose features or points are labelled.")
    ],
    output: Annotated[
        Path,
        FileOut(
            label="Classifier", help="For the tools that register images.", suffixes=(".json",)
        ),
    ],
    labels: Annotated[
        Path | None,
        VectorIn(
            label="Labelled layer",
            help="Points, or polygons around features, with an attribute that gives their class.",
        ),
    ] = None,
    label_raster: Annotated[
        Path | None,
        RasterIn(
            label="Labelled raster",
            help="A raster whose values give the class of features: a cloud mask.",
        ),
    ] = None,
    field: Annotated[
        str, Text(label="Attribute", help="The layer's attribute that gives the class.")
    ] = "class",
    left_out: Annotated[
        str,
        Text(
            help="Values of the attribute or of the raster, separated by commas, whose features "
            "are to be left out; those of all other values are kept.",
        ),
    ] = "1",
    kernel: Annotated[
        str,
        Choice(
            help="Of the support vector machine; polynomial is of degree 3, quadratic of 2.",
            choices=KERNELS,
        ),
    ] = "polynomial",
    statistics: Annotated[
        str,
        Choice(
            help="What is looked at in the 41 × 41 pixels around a feature: mean and variance of "
            "the grey values, these with the shares of all bands in their sum (band-ratios: clouds "
            "have no colour), or with skewness, gradients and fine detail (texture).",
            choices=tuple(STATISTICS),
        ),
    ] = BAND_RATIOS,
    band: Annotated[
        int | None,
        Band(
            help="The band that is looked at, as it will be matched; by default the mean of all "
            "bands.",
            of="input",
            advanced=True,
        ),
    ] = None,
    seed: general.Seed = 0,
    progress: Progress = SILENT,
) -> TrainingResult:
    """Train a classifier that keeps features on clouds, shadows or changes out of the matching.

    A support vector machine learns to separate features that are to be kept from others, by
    the image around them. Features are found in the image and labelled by what a raster or
    polygons give for the patch around them: a quarter of it is enough to be left out. A layer's
    points are taken as they are, and both their classes count alike. The classifier is for images
    of the same kind: the same bands, units and about the same pixel size.
    """
    if (labels is None) == (label_raster is None):
        raise ParameterError("give labels or label_raster, one of them")
    values = tuple(text.strip() for text in left_out.split(",") if text.strip())
    if not values:
        raise ParameterError("left_out names no value")
    with ExitStack() as stack:
        image = Image(stack.enter_context(open_raster(input)), band)
        source: LabelSource
        if labels is not None:
            source = layer_labels(labels, field, values, image.source.grid)
        else:
            assert label_raster is not None
            source = raster_labels(stack.enter_context(open_raster(label_raster)), values)
        detector = SiftDetector(_CONTRAST)
        with threads(progress=progress.part(0.0, 0.6)) as context:
            points = labelled_points(image, source, detector, statistics, context)
        size_m = image.source.grid.pixel_size_m
    progress.update(0.6, "training")
    classifier = train_classifier(points, statistics, kernel, size_m, seed, source.chosen)
    accuracy = left_out_accuracy(points, statistics, kernel, seed, source.chosen)
    with Outputs() as outputs:
        classifier.write(outputs.stage(output))
    return TrainingResult(
        output,
        int(points.kept.sum()),
        int((~points.kept).sum()),
        len(classifier.weights),
        accuracy if math.isfinite(accuracy) else None,
    )
