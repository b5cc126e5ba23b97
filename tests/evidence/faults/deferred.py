"""Checks and actions with parameters: each is written as one function of its subject and of the parameters."""

from collections.abc import Callable
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar

S = TypeVar("S")
P = ParamSpec("P")
R = TypeVar("R")


def deferred(function: Callable[Concatenate[S, P], R]) -> Callable[P, Callable[[S], R]]:
    """Let a function take its other arguments now, and its first one (a site, or evidence) later."""

    @wraps(function)
    def bind(*arguments: P.args, **keywords: P.kwargs) -> Callable[[S], R]:
        return lambda subject: function(subject, *arguments, **keywords)

    return bind
