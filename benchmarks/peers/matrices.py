"""What the peers' scripts share: their number of threads, and how they tell what they found."""

import json
import os

import numpy as np


def threads():
    """Return how many threads a peer may use."""
    return int(os.environ.get("OMP_NUM_THREADS") or os.cpu_count())


def translation(shift_px):
    """Return the matrix of a shift: what the input shows lies so far (right, down) in it."""
    return [[1.0, 0.0, float(shift_px[0])], [0.0, 1.0, float(shift_px[1])]]


def tell(matrix):
    """Print the 2×3 matrix from reference to input pixels, or null for none, as a line of JSON."""
    print(json.dumps(None if matrix is None else np.asarray(matrix, float).tolist()))
