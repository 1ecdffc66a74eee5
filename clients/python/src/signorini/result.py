"""`Result` under the name of a module of its own, as programs and pickles may have it; it is in `job`, beside `Job`:
each of the two makes the other."""

from .job import Result

__all__ = ["Result"]
