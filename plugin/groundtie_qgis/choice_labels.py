"""Labels in dialogs for the command line's choice words; in English."""

from __future__ import annotations

# Words that need more than a capital letter; all other words are their own labels.
_LABELS = {
    "auto": "Automatic",
    "translation": "Translation (shift alone)",
    "rigid": "Rigid (shift and rotation)",
    "similarity": "Similarity (shift, rotation, scale)",
    "affine": "Affine (degree 1)",
    "polynomial2": "Polynomial of degree 2",
    "polynomial3": "Polynomial of degree 3",
    "tps": "Thin-plate spline",
    "shift_drift": "Shift that drifts along the rows",
    "reference": "The reference's pixels",
    "input": "Pixels as the input's",
    "untouched": "Input's pixels untouched, geotransform corrected",
    "ellipsoidal": "Ellipsoid",
    "rbf": "Gaussian (RBF)",
    "mean-variance": "Mean and variance",
    "spsa": "SPSA",
    "spsa2": "SPSA of second order",
    "discrete-spsa": "Discrete SPSA",
    "nelder-mead": "Nelder–Mead",
    "fourier-mellin": "Fourier–Mellin",
    "ncc": "Normalised cross-correlation",
    "nmi": "Normalised mutual information",
    "mi": "Mutual information",
    "mlmi": "MLMI",
    "renyi": "Rényi",
    "fused": "Mutual information and orientation",
    "kd-tree": "k-d tree (approximate)",
    "isef": "ISEF",
    "sar": "SAR",
    "gamma-map": "Gamma MAP",
    "enhanced-frost": "Enhanced Frost",
}


def label_of(word: str) -> str:
    """Return the label of a word."""
    plain = word.replace("-", " ").replace("_", " ")
    return _LABELS.get(word, plain[:1].upper() + plain[1:])
