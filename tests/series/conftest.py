from __future__ import annotations

from contexts import context, one_thread

__all__ = ["context", "one_thread"]
