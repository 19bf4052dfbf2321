"""Call a function once a module was imported, by whomever: nothing is imported before a script does."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from importlib.machinery import ModuleSpec
    from types import ModuleType


@contextmanager
def after_import(name: str, function: Callable[[ModuleType], None]) -> Iterator[None]:
    """Within this context, call function(module) when the module has been imported; at once if it is there."""
    if name in sys.modules:
        function(sys.modules[name])
        yield
        return
    finder = _Finder(name, function)
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        finder.leave()


class _Finder:
    """Finds nothing by itself: lets the other finders find the module, and has its loader call the function."""

    def __init__(self, name: str, function: Callable[[ModuleType], None]):
        self._name, self._function = name, function

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        if name != self._name:
            return None
        self.leave()  # what is below asks the finders again
        spec = find_spec(name)
        if spec is not None and spec.loader is not None:
            spec.loader = _Loader(spec.loader, self._function)
        return spec

    def leave(self) -> None:
        if self in sys.meta_path:
            sys.meta_path.remove(self)


class _Loader:
    """A loader that does what another one does, and calls a function afterwards."""

    def __init__(self, loader: Any, function: Callable[[ModuleType], None]):
        self._loader, self._function = loader, function

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        module.__loader__ = module.__spec__.loader = self._loader  # as if we had not been there
        self._loader.exec_module(module)
        self._function(module)
