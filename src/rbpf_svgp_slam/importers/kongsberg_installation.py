"""Kongsberg's installation texts: where the arrays and sensors are, and how they are turned.

X forward, Y to starboard, Z down from the reference point, m; R, P, H in degrees.
"""

from __future__ import annotations

import re

import numpy as np

from rbpf_svgp_slam.importers.sonar_recording import Installation, Placed


def kmall_installation(text: str, assumed: list[str]) -> tuple[str, Installation]:
    """The sonar's name and all that #IIP tells; assumed: lines for the summary are added."""
    model = re.search(r"EMXV:([^,\n]*)", text)
    # TRAI_HD1:N=2032;X=1.100;...,  with the text's commas between such groups
    groups = {
        name: dict(re.findall(r"(\w+)=([^;,]*)", values))
        for name, values in re.findall(r"(\w+):((?:\w+=[^;,]*;?)+)", text)
    }
    head = groups.get("TRAI_HD1", {})
    transmitter = _placed(groups.get("TRAI_TX1", head), "")
    receiver = _placed(groups.get("TRAI_RX1", head), "")
    if head:
        transmitter, receiver = _within(transmitter, head, "IC"), _within(receiver, head, "IR")
        assumed.append("all sectors are sent from the middle of the transmitter")
    for name in ("TRAI_HD2", "TRAI_TX2", "TRAI_RX2"):
        if name in groups:
            assumed.append(f"the first of several arrays: {name} is left out")
    active = [name for name, group in groups.items() if name.startswith("ATTI") and "X" in group]
    motion = _placed(groups[active[0]], "") if active else Placed()
    waterline_m = _number(groups.get("EMXI", {}), "SWLZ")
    name = f"Kongsberg {model.group(1).strip()}" if model else "Kongsberg"
    return name, Installation(transmitter, receiver, Placed(), motion, waterline_m)


def all_installation(text: str) -> Installation:
    """What an installation datagram of .all tells."""
    values = dict(re.findall(r"(\w+)=([^,]*)", text))
    active = {"2": "MS", "3": "NS"}.get(values.get("ARO", "2"), "MS")
    angles = (values.get(active + name, "0") for name in "RPG")
    motion = Placed(*(_number(values, active + axis) for axis in "XYZ"), *_radians(angles))
    return Installation(
        transmitter=_numbered(values, "S1"),
        receiver=_numbered(values, "S2"),
        positioning=Placed(),
        motion=motion,
        waterline_m=_number(values, "WLZ"),
    )


def _numbered(values: dict[str, str], array: str) -> Placed:
    return _placed({key[len(array) :]: values[key] for key in values if key.startswith(array)}, "")


def _placed(values: dict[str, str], prefix: str) -> Placed:
    place = (_number(values, prefix + axis) for axis in "XYZ")
    return Placed(*place, *_radians(values.get(prefix + angle, "0") for angle in "RPH"))


def _within(head: Placed, values: dict[str, str], prefix: str) -> Placed:
    """A part of a head, whose place is given in the head's own axes."""
    part = _placed(values, prefix)
    return Placed(
        head.forward_m + part.forward_m,
        head.starboard_m + part.starboard_m,
        head.down_m + part.down_m,
        head.roll_rad,
        head.pitch_rad,
        head.heading_rad,
    )


def _number(values: dict[str, str], name: str) -> float:
    return float(values.get(name) or 0.0)


def _radians(texts) -> list[float]:
    return [float(np.radians(float(text or 0.0))) for text in texts]
