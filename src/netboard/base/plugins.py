"""What other packages add to netboard: the entries of an entry-point group, each loaded when it is used."""

from collections.abc import Iterable, Mapping
from importlib.metadata import entry_points
from pkgutil import resolve_name

from netboard.base.errors import NetboardError
from netboard.base.nearest import did_you_mean


def names(group: str, built_in: Iterable[str]) -> tuple[str, ...]:
    """Return the names of all entries, netboard's own and those of other packages, sorted."""
    return tuple(sorted({*built_in, *(point.name for point in entry_points(group=group))}))


def load(group: str, name: str, built_in: Mapping[str, str], what: str, error: type[NetboardError]) -> object:
    """Return the object of an entry; raise this error in words if there is none, or two, or if it does not load.

    `built_in` has netboard's own entries by name, each as ``module:attribute``.
    """
    targets = [built_in[name]] if name in built_in else []
    targets += [point.value for point in entry_points(group=group, name=name)]
    if not targets:
        known = names(group, built_in)
        raise error(f"this machine has no {what} {name!r}; it has: {', '.join(known)}{did_you_mean(name, known)}")
    if len(targets) > 1:
        found = " and ".join(targets)
        raise error(f"this machine has {len(targets)} {what}s {name!r}: {found}; expected one")
    try:
        return resolve_name(targets[0])
    except Exception as failure:  # the code of another package may raise anything
        why = f"{type(failure).__name__}: {failure}"
        raise error(f"the {what} {name!r} ({targets[0]}) cannot be loaded: {why}") from failure
