"""Stacks of images of one size, shape (…, h, w), for functions that take one image at a time.

Functions of this package take single images, (h, w), and stacks of them alike. A stack of chips is
processed in one call: many small calls would cost more than their computation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def each(function: Callable[..., Array], *stacks: Array) -> Array:
    """Apply a function to the images of stacks, (…, h, w), one after the other.

    Parameters
    ----------
    function
        Takes one image of each stack; returns arrays of one shape.
    stacks
        Stacks of the same leading shape.
    """
    leading = stacks[0].shape[:-2]
    images = (stack.reshape(-1, *stack.shape[-2:]) for stack in stacks)
    # Not np.stack, which takes as long as some of the functions.
    made = np.array([function(*of_one) for of_one in zip(*images, strict=True)])
    return made.reshape(leading + made.shape[1:])


def flat(stack: Array) -> Array:
    """Return the pixels of each image along one axis, shape (…, h w)."""
    return stack.reshape(*stack.shape[:-2], stack.shape[-2] * stack.shape[-1])
