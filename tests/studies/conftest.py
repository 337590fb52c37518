"""The context that the tests share."""

from contexts import context, one_thread

__all__ = ["context", "one_thread"]
