"""Classifiers of features that know nothing but how bright the image is."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from groundtie.features.classifier_training import Training, train_classifier


def bright_is_left_out(path: Path, limit: float) -> Path:
    """Write a classifier that leaves out patches with means above a limit."""
    random = np.random.default_rng(0)
    means = np.concatenate([random.uniform(0, limit, 300), random.uniform(limit, 2 * limit, 300)])
    statistics = np.column_stack([means, random.uniform(0, 1e5, 600)])
    labelled = Training(statistics, means < limit, random.uniform(0, 100, (600, 2)))
    train_classifier(labelled, "mean-variance", "linear", 10.0, 0).write(path)
    return path
