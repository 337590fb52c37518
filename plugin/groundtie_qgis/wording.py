"""How dialogs name choices and tools: the command line's words are not for them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

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
    "none": "No mask",
    "threshold": "All but strong scatterers",
    "regions": "Homogeneous ground alone",
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
    "gamma-map": "Gamma MAP",
}


def choice_label(word: str) -> str:
    """Return what dialogs show for a word of the command line."""
    plain = word.replace("-", " ").replace("_", " ")
    return _LABELS.get(word, plain[:1].upper() + plain[1:])


def in_words(text: str, tool: Any, tools: Iterable[Any]) -> str:
    """Return a help text with the titles of tools and the labels of a tool's parameters.

    Parameters
    ----------
    text
        The text of a declaration.
    tool
        The tool whose text it is; None: of none.
    tools
        All tools.
    """
    named = {other.name: other.title for other in tools}
    parameters = () if tool is None else tool.parameters
    named |= {parameter.name: parameter.kind.label for parameter in parameters}
    # Short names are English words, too: only what is said to be a tool is one.
    words = (name for name in named if "_" in name or name == "coregister")
    long = "|".join(sorted(words, key=len, reverse=True))
    short = "|".join(sorted(named, key=len, reverse=True))
    pattern = rf"`({short})`|the tool ({short})\b" + (rf"|\b({long})\b" if long else "")
    return re.sub(pattern, lambda found: f"“{named[next(filter(None, found.groups()))]}”", text)
