"""A count with its noun in a message, such as "1 session" and "2 sessions"."""

_IRREGULAR = {"person": "people", "success": "successes", "": ""}


def noun(count: int, one: str, several: str = "") -> str:
    """Return the singular or the plural of a noun; ``several``: its plural, if the verb changes with it."""
    return one if count == 1 else several or _IRREGULAR.get(one, f"{one}s")


def plural(count: int, one: str, several: str = "") -> str:
    """Return a count with its noun, as in `noun`."""
    return f"{count} {noun(count, one, several)}"
