"""What registers itself: our own kinds by lying in a package, those of others through entry points."""

from __future__ import annotations

import importlib
import inspect
import logging
import pkgutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from types import ModuleType
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from circuitkit.base.errors import UnknownNameError

_LOG = logging.getLogger(__name__)

T = TypeVar("T")


def plugged_in(word: str, read: Callable[[EntryPoint], Iterable[T]]) -> Iterator[T]:
    """What the plug-ins of others bring, in the alphabetical order of their entry points.

    Args:
        word: The end of the group's name `circuitkit.WORD`.
        read: Gives what an entry point brings. Where it raises an exception, a warning says so, and the
            plug-in is left out.
    """
    group = f"circuitkit.{word}"
    for point in sorted(entry_points(group=group), key=lambda point: (point.name, point.value)):
        try:
            found = tuple(read(point))
        except Exception as error:  # a plug-in of others may fail in any way, and must not stop us
            why = f"{type(error).__name__}: {error}"
            _LOG.warning("the plug-in '%s' of %s is left out: %s", point.name, group, why)
        else:
            yield from found


class Kind(Protocol):
    """A class that can be registered.

    Attributes:
        kind: The word by which files name it.
    """

    kind: ClassVar[str]


KindT = TypeVar("KindT", bound=Kind)


class Registry(Generic[KindT]):
    """All kinds of one sort, such as the references or the disturbances.

    A kind is a class derived from `base` with a `kind` of its own. It is found in any module of `package`,
    and in what the entry points of the group `circuitkit.WORD` name: a class, a module, or a package.

    Attributes:
        every: The registries that there are, by their word.
    """

    every: ClassVar[dict[str, Registry[Any]]] = {}

    def __init__(self, word: str, base: type[KindT], package: str | None = None) -> None:
        """Describe where to look.

        Args:
            word: What they are, in the plural, such as "references".
            base: What they are derived from.
            package: Where our own lie.
        """
        self.word = word
        self._base = base
        self._package = package
        self.every[word] = self

    @cached_property
    def kinds(self) -> Mapping[str, type[KindT]]:
        """The classes by their `kind`, in alphabetical order. A warning names plug-ins that fail."""
        found = {each.kind: each for each in self._own()}
        for each in plugged_in(self.word, lambda point: list(self._of(point))):
            if (there := found.setdefault(each.kind, each)) is not each:
                theirs, ours = (f"{kind.__module__}.{kind.__qualname__}" for kind in (each, there))
                why = f"there is {ours} already; allowed: another `kind`"
                _LOG.warning(
                    "the kind '%s' of %s is left out of the %s: %s", each.kind, theirs, self.word, why
                )
        return dict(sorted(found.items()))

    def __getitem__(self, kind: str) -> type[KindT]:
        """The class of a kind.

        Raises:
            UnknownNameError: There is none; lists those there are.
        """
        if kind not in self.kinds:
            what = f"kind of {self.word}"
            raise UnknownNameError(what, kind, self.kinds)
        return self.kinds[kind]

    def _own(self) -> Iterator[type[KindT]]:
        if self._package is not None:
            yield from self._in_module(importlib.import_module(self._package))

    def _of(self, point: EntryPoint) -> Iterator[type[KindT]]:
        loaded = point.load()
        if isinstance(loaded, ModuleType):
            yield from self._in_module(loaded)
        else:
            yield loaded

    def _in_module(self, module: ModuleType) -> Iterator[type[KindT]]:
        modules = [module]
        for found in pkgutil.iter_modules(getattr(module, "__path__", ())):
            modules.append(importlib.import_module(f"{module.__name__}.{found.name}"))
        for each in modules:
            for _, value in inspect.getmembers(each, inspect.isclass):
                own = value.__module__ == each.__name__ and "kind" in vars(value)
                if own and issubclass(value, self._base):
                    yield value
