"""The red team: attacks that provoke silently wrong registrations, and how often they succeed."""

from .suite import run

__all__ = ["run"]
