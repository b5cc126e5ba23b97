"""Commands for a shell, as messages and reports advise them."""

import shlex


def shell_command(*words: object) -> str:
    """Return a line with correct shell quoting; invisible characters are escaped, as bash and zsh read them."""
    return " ".join(shlex.quote(word) if word.isprintable() else _escaped(word) for word in map(str, words))


def _escaped(word: str) -> str:
    """Quote a word with escapes for all unsafe characters."""
    data = word.encode("utf-8", "surrogateescape")
    return "$'" + "".join(chr(b) if 32 <= b < 127 and chr(b) not in "'\\" else f"\\x{b:02x}" for b in data) + "'"
