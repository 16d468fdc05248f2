"""Cache of a method's results that are computed once for each fabric.

Fabrics of equal optics share an entry. A known fabric object is found by its identity, because a fingerprint takes
longer than a few hundred queries. One thread computes; others wait for its product.
"""

from collections.abc import Callable
from threading import RLock
from typing import Generic, TypeVar

from pipeline.fingerprint import fingerprint
from weaves.fabric import Fabric

Made = TypeVar("Made")

_MOST_OBJECTS = 256  # fabric objects remembered; an editor makes a new one at every edit


class PerFabric(Generic[Made]):
    """Products of fabrics, which depend on their optics alone, each made at its first use and then kept."""

    def __init__(self, make: Callable[[Fabric], Made]) -> None:
        self._make = make
        self._lock = RLock()
        self._products: dict[str, Made] = {}
        # The fabric is kept beside its product: an identity is another object's once its own is gone.
        self._objects: dict[int, tuple[Fabric, Made]] = {}

    def of(self, fabric: Fabric) -> Made:
        """Return the product of a fabric."""
        known = self._objects.get(id(fabric))
        if known is not None:
            return known[1]
        key = fingerprint(fabric.optics())
        with self._lock:
            if key not in self._products:
                self._products[key] = self._make(fabric)
            if len(self._objects) >= _MOST_OBJECTS:
                self._objects.clear()
            self._objects[id(fabric)] = fabric, self._products[key]
            return self._products[key]
