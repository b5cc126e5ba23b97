"""The tables of FORMAT.md, made from the channel table. Run as a script, this brings them up to date."""

from pathlib import Path

from netboard.recording.format import channels
from netboard.recording.format.channels import CHANNELS, Channel, Field

FORMAT = Path(channels.__file__).with_name("FORMAT.md")
BEGIN, END = "<!-- tables: begin (made by tests/recording/format_tables.py) -->", "<!-- tables: end -->"

TYPES = {"integer": "int64", "number": "float64", "string": "str", "bytes": "bytes"}
TYPES |= {"texts": "map of str to str", "numbers": "list of float64"}


def table(what: str, fields: tuple[Field, ...]) -> list[str]:
    """Some fields, a row each."""
    rows = [f"| `{f.name}` | {TYPES[f.kind]} | {f.unit} | {f.text} |" for f in fields]
    return [f"| {what} | type | unit | meaning |", "| --- | --- | --- | --- |", *rows]


def section(number: int, channel: Channel) -> str:
    """All about one channel."""
    lines = [
        f"### `{channel.topic}`: channel {number}, schema `{channel.schema_name}`",
        "",
        f"{channel.about[0].upper()}{channel.about[1:]}.",
        f"`sequence`: {channel.sequence}. `publish_time`: {channel.publish_time}.",
        "",
        *table("field", channel.fields),
    ]
    if channel.columns:
        lines += ["", "Its columns:", "", *table("column", channel.columns)]
    return "\n".join(lines) + "\n"


def renewed(text: str) -> str:
    """FORMAT.md with its tables up to date."""
    tables = "\n".join(section(number, channel) for number, channel in enumerate(CHANNELS, start=1))
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{tables}\n{END}{after}"


if __name__ == "__main__":
    FORMAT.write_text(renewed(FORMAT.read_text(encoding="utf-8")), encoding="utf-8")
