"""Attributes of results that ``help()`` describes."""

from __future__ import annotations

from functools import cached_property
from inspect import cleandoc
from typing import Any, Generic, TypeVar, overload

T = TypeVar("T")


class Attribute(Generic[T]):
    """A value that every result has of its own, with its description.

    >>> import leafdyn
    >>> leafdyn.Equilibrium.tolerance.__doc__
    'The accuracy that was wanted, relative to the longest rod.'
    """

    def __init__(self, description: str) -> None:
        self.__doc__ = cleandoc(description)

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, found: None, owner: type) -> Attribute[T]: ...

    @overload
    def __get__(self, found: object, owner: type) -> T: ...

    def __get__(self, found: object | None, owner: type) -> Attribute[T] | T:
        if found is None:
            return self
        try:
            value: T = found.__dict__[self._name]
        except KeyError:
            why = "is not in the files that it was loaded from"
            raise AttributeError(f"{owner.__name__}.{self._name} {why}") from None
        return value

    def __set__(self, found: object, value: T) -> None:
        found.__dict__[self._name] = value


class computed(cached_property[T]):
    """A value that is made when it is first asked for, and kept."""

    # As a data descriptor `help()` describes it.
    def __set__(self, found: object, value: Any) -> None:
        raise AttributeError(f"{type(found).__name__}.{self.attrname} cannot be set")
