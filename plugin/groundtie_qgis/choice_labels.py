"""What dialogs show for the words that the command line has for choices; in English."""

from __future__ import annotations

# Words that a capital does not make clear; all others stand for themselves.
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
    # Tools, by their titles (a test compares).
    "register": "Register images",
    "coregister": "Co-register images",
    "match_sar_sar": "Match SAR with SAR",
    "match_optical": "Match optical images",
    "coregister_series": "Co-register a series",
    "train_feature_classifier": "Train a feature classifier",
    "estimate_rotation": "Estimate rotation and scale",
    "warp": "Warp a raster",
    "extract_gcps": "Extract ground control",
    "refine_rpc": "Refine RPCs",
    "assess": "Assess a registration",
    "assess_sensor": "Assess RPCs",
    "detector_repeatability": "Repeatability of detectors",
    "mask_threshold": "Mask by thresholds",
    "mask_ground": "Mask by layover and shadow",
    "mask_regions": "Mask by regions",
    "mask_surface": "Mask by a surface model",
    "simulate": "Simulate a SAR–optical pair",
    "simulate_sensor": "Simulate a sensor image",
}


def label_of(word: str) -> str:
    """Return the label of a word."""
    plain = word.replace("-", " ").replace("_", " ")
    return _LABELS.get(word, plain[:1].upper() + plain[1:])
