"""The red team: what deceives a registration, and how often it is silently wrong."""

from .suite import run

__all__ = ["run"]
