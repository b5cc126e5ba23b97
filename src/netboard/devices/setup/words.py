"""Formats the results of the device tools, as tables and as plain values for JSON."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from math import floor, log10

from rich.console import Group, RenderableType
from rich.text import Text

from netboard.base.finding import Finding
from netboard.base.terminal.output import FittedTable, numbers
from netboard.devices.contract.device import DeviceInfo, Reading
from netboard.devices.contract.profile import Placement
from netboard.devices.setup.identification import Identified, ParameterEstimate
from netboard.devices.setup.listing import DeviceListing

UNITS = {"mass": "kg", "damping": "N s/m", "friction": "N", "load": "N", "delay": "ms", "stiffness": "N/m"}
"""Displayed unit of each estimate."""


def listing_tables(found: DeviceListing) -> RenderableType:
    """Format devices and backends as tables, with advice below each device that may not be opened."""
    devices = FittedTable("device", "serial", "USB", "at", "seen by", title="Devices")
    for each in found.devices:
        model = Text(each.model)
        if each.shut:
            model.append(f"\nno permission for {', '.join(each.shut)}", "bold red")
        devices.add_row(model, each.serial or "?", each.usb, each.place, ", ".join(each.seen_by))
    backends = FittedTable("backend", "", title="Backends")
    for name, trouble in found.backends:
        backends.add_row(name, Text(trouble, "yellow") if trouble else "available")
    advice = [Text(advice, "bold") for advice in dict.fromkeys(each.advice for each in found.devices) if advice]
    parts = [devices if found.devices else Text("no USB haptic device found"), *advice, backends]
    return Group(*parts, *(Text(remark, "yellow") for remark in found.remarks))


def plain_listing(found: DeviceListing) -> Mapping[str, object]:
    """Convert a listing for JSON."""
    return {
        "devices": [{**asdict(each), "advice": each.advice} for each in found.devices],
        "backends": [{"name": name, "usable": not trouble, "trouble": trouble} for name, trouble in found.backends],
        "remarks": list(found.remarks),
    }


def findings_table(title: str, findings: Iterable[Finding]) -> FittedTable:
    """Format findings as a table, with advice below each one that is not green."""
    table = FittedTable("", "", "", title=title, header=False)
    for finding in findings:
        found = Text(finding.found)
        if finding.advice:
            found.append(f"\n{finding.advice}", "bold")
        table.add_row(Text(finding.colour, finding.colour), finding.name, found)
    return table


def identified_table(title: str, found: Identified) -> FittedTable:
    """Format estimates with their 95 % confidence intervals and the misfit of the model."""
    table = FittedTable("", *numbers("estimate", "+- (95 %)"), "", title=title)
    for name, value, half_width, unit in _estimates(found):
        digits = max(0, 1 - floor(log10(half_width))) if half_width > 0.0 else 4
        table.add_row(name, f"{value:.{digits}f}", f"{half_width:.{digits}f}", unit)
    table.add_row("rms residual", f"{found.misfit * 1e3:.3g}", "", f"mm of {found.travel * 1e3:.1f} mm")
    return table


def plain_identified(info: DeviceInfo, found: Identified) -> Mapping[str, object]:
    """Convert estimates for JSON, in SI units."""
    estimates = {name: {"value": value, "half_width": half} for name, (value, half) in _by_name(found).items()}
    return {
        "model": info.model,
        "serial": info.serial,
        **estimates,
        "misfit": found.misfit,
        "travel": found.travel,
        "windows": found.windows,
    }


def placement_table(title: str, place: Placement) -> FittedTable:
    """Format origin, workspace and scale, in millimetres."""
    table = FittedTable("", *numbers("x", "y", "z"), "", title=title)
    rows = {"zero": (place.zero_x, place.zero_y, place.zero_z), "workspace from": place.box[:3], "to": place.box[3:]}
    for name, values in rows.items():
        table.add_row(name, *(f"{value * 1e3:.1f}" for value in values), "mm")
    table.add_row("scale", "", "", f"{place.scale:.3f}", "")
    return table


def reading_table(title: str, reading: Reading) -> FittedTable:
    """Format one reading in the scene's frame."""
    table = FittedTable("", *numbers("x", "y", "z"), "", title=title)
    table.add_row("position", *(f"{value * 1e3:8.2f}" for value in (reading.x, reading.y, reading.z)), "mm")
    table.add_row("velocity", *(f"{value * 1e3:8.1f}" for value in (reading.vx, reading.vy, reading.vz)), "mm/s")
    ready = Text("ready for forces", "green") if reading.ready else Text("not ready for forces", "yellow")
    table.add_row("buttons", f"{reading.buttons:b}", "", "", ready)
    return table


def _by_name(found: Identified) -> Mapping[str, ParameterEstimate]:
    return {name: getattr(found, name) for name in UNITS}


def _estimates(found: Identified) -> Iterable[tuple[str, float, float, str]]:
    """Yield the estimates that were made, in displayed units."""
    for name, (value, half_width) in _by_name(found).items():
        times = 1e3 if name == "delay" else 1.0
        if value or half_width:
            yield name, value * times, half_width * times, UNITS[name]
