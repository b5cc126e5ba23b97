"""Errors on the terminal: what a file or a name contains must neither control the terminal nor fill it."""

import typer

MOST = 1000
"""Longest line of an error; more is cut out of its middle [1]."""


def print_error(words: str) -> None:
    """Print an error as the last word of a command."""
    typer.secho(f"netboard: {harmless(words)}", err=True, fg=typer.colors.RED)


def harmless(words: str) -> str:
    """Return lines without control characters, each of at most `MOST` characters."""
    return "\n".join(map(_line, words.split("\n")))


def _line(text: str) -> str:
    text = "".join(one if one.isprintable() else one.encode("unicode_escape").decode("ascii") for one in text)
    half = MOST // 2
    return text if len(text) <= MOST else f"{text[:half]} ... ({len(text) - 2 * half} characters) ... {text[-half:]}"
