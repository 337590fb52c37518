"""Belief propagation between the similarity surfaces of neighbouring chips.

Neighbouring places are misregistered by nearly the same shift. Chips are the nodes of a graph,
and their shifts are its unknowns. Loopy belief propagation (sum-product) passes messages between
them. A message holds the shifts that a chip's own surface and its other neighbours make likely,
blurred by the expected difference of shifts. A surface without a clear peak passes messages on, so
that they reach across places without evidence.

Source: [Pearl1988], [Murphy1999].
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

Surfaces = NDArray[np.float32]
_Pairs = NDArray[np.intp]

# Standard deviation of the difference between neighbours' shifts, along each axis.
_DIFFERENCE_PX = 2.0

# Prior shares of chips without evidence in their surface, and of neighbours that are unrelated.
_NO_EVIDENCE = 0.7
_UNRELATED = 0.1

# Number of passes, and of chips across which a message travels.
_PASSES = 8

# Number of pairs whose messages are computed at a time, to fit into the processor's cache.
_BLOCK = 128


def propagate(surfaces: Surfaces, centres: NDArray[np.int_], reach_px: float) -> Surfaces:
    """Add to each surface the messages of its neighbours, so that weak peaks that agree are found.

    The result's surfaces are not independent of each other: a verdict must not count them.

    Parameters
    ----------
    surfaces
        Shape (n, 2 r + 1, 2 r + 1), in robust standard deviations.
    centres
        The chips' centres, shape (n, 2).
    reach_px
        Distance up to which chips are neighbours. Their shifts should not differ by more than
        about 4 px along each axis: compensate the known misregistration first.

    Returns
    -------
    Array of the shape of `surfaces`, float32: the logarithm of the likelihood of each shift by the
    chip and its neighbours together, up to a constant. Chips without neighbours keep their own
    surface.
    """
    if len(surfaces) == 0:
        return surfaces
    count, span = surfaces.shape[:2]
    # Chip by chip, as a matrix of all distances grows with the square of the number of chips.
    later = [
        k + 1 + np.flatnonzero(np.hypot(*(centres[k + 1 :] - centres[k]).T) <= reach_px)
        for k in range(count)
    ]
    first = np.repeat(np.arange(count), [len(of) for of in later])
    pairs = np.column_stack([first, np.concatenate(later)])
    prior = _log_evidence(surfaces.reshape(count, -1))
    beliefs: Surfaces = prior + _messages(prior, pairs, span)
    alone = np.bincount(pairs.ravel(), minlength=count) == 0
    beliefs[alone] = surfaces[alone].reshape(-1, span * span)
    return beliefs.reshape(surfaces.shape)


def _log_evidence(surfaces: Surfaces) -> Surfaces:
    """Return the log likelihood ratio of each shift being true to the surface having no evidence.

    For a surface of unit variance, the likelihood of a shift is proportional to the exponential of
    its value. The share of chips without evidence keeps the evidence against a shift bounded.

    Parameters
    ----------
    surfaces
        Shape (n, shifts).
    """
    likely = np.exp(surfaces - surfaces.max(axis=1, keepdims=True))
    likely *= np.float32(1 - _NO_EVIDENCE) / likely.mean(axis=1, keepdims=True)
    return np.asarray(np.log(likely + np.float32(_NO_EVIDENCE)), np.float32)


def _messages(prior: Surfaces, pairs: _Pairs, span: int) -> Surfaces:
    """Return the sum of the messages that each chip receives.

    Parameters
    ----------
    prior
        Logarithms of evidence, shape (n, span²).
    pairs
        Indices of neighbours, each pair once, shape (m, 2).
    span
        Side of the surfaces.

    Returns
    -------
    Shape (n, span²).
    """
    received = np.zeros((2, len(pairs), prior.shape[1]), np.float32)
    to_second, to_first = (_incidence(pairs[:, side], len(prior)) for side in (1, 0))
    kernel = _difference_kernel(span)
    total: Surfaces = np.zeros_like(prior)
    for _ in range(_PASSES):
        belief = prior + total
        belief -= belief.max(axis=1, keepdims=True)
        for start in range(0, len(pairs), _BLOCK):
            block = slice(start, start + _BLOCK)
            first, second = pairs[block].T
            # A message excludes what the sender received from the recipient.
            sent = np.stack(
                [belief[first] - received[1, block], belief[second] - received[0, block]]
            )
            received[:, block] = _blurred(sent, kernel)
        total = to_second @ received[0] + to_first @ received[1]
    return total


def _blurred(sent: Surfaces, kernel: Surfaces) -> Surfaces:
    """Return messages as neighbours receive them: logarithms, 0 without evidence.

    Parameters
    ----------
    sent
        Log likelihoods of the sender's shifts, shape (2, m, span²).
    kernel
        See `_difference_kernel`.
    """
    span = len(kernel)
    likely = np.exp(sent)
    mean = likely.mean(axis=2, keepdims=True)
    along_columns = (likely.reshape(-1, span) @ kernel).reshape(-1, span, span)
    blurred = np.matmul(kernel, along_columns).reshape(sent.shape)
    blurred *= np.float32((1 - _UNRELATED) / _UNRELATED) / mean
    return np.asarray(np.log1p(blurred, out=blurred), np.float32)


def _difference_kernel(span: int) -> Surfaces:
    """Return the probability of a neighbour's shift given the other's, along an axis."""
    shifts = np.arange(span)
    everywhere = np.exp(-0.5 * (np.arange(-span, span + 1) / _DIFFERENCE_PX) ** 2).sum()
    differences = (shifts[:, None] - shifts) / _DIFFERENCE_PX
    return np.asarray(np.exp(-0.5 * differences**2) / everywhere, np.float32)


def _incidence(nodes: _Pairs, count: int) -> csr_matrix:
    """Return the matrix that sums rows of messages by their recipient."""
    edges = np.arange(len(nodes))
    return csr_matrix((np.ones(len(nodes), np.float32), (nodes, edges)), shape=(count, len(nodes)))
