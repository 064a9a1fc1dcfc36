"""What is known of a bag before it is judged. Needs no ROS."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Dict

import numpy as np

#: Numbers by column, all of one length.
Table = Dict[str, np.ndarray]


@dataclass(frozen=True)
class Topic:
    """One of a bag's topics; times are those of the recording."""

    name: str
    type: str
    messages: int
    begin_s: float
    end_s: float
    is_odometry: bool  # of a type that is taken as odometry, or as pings
    is_pings: bool
    frame: str  # of its first message, where it is such a topic
    child_frame: str

    @property
    def rate_hz(self) -> float:
        """Messages a second, pauses included."""
        duration_s = self.end_s - self.begin_s
        return (self.messages - 1) / duration_s if duration_s > 0 else 0.0


@dataclass(frozen=True)
class Mount:
    """Where a sensor is on the vehicle; None if the bag does not say."""

    frame: str
    translation_m: tuple[float, float, float] | None = None
    roll_pitch_yaw_rad: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Refused:
    """Messages that SLAM would refuse for one reason."""

    messages: int
    first: str  # what is wrong with the first of them


@dataclass(frozen=True)
class Noted:
    """What the filter's own checks of the survey as a whole say."""

    name: str
    severity: str
    text: str


@dataclass(frozen=True)
class ChosenTopics:
    """Topics by what they are for; None where there is none."""

    odometry: Topic | None
    pings: Topic | None
    ground_truth: Topic | None = None


@dataclass
class Facts:
    """All that the findings are made of.

    Tables, whose columns are named with their units, stamps and record times in s since the epoch:
    odometry that is taken in; pings as they came; placed, those of them that are taken in, by the
    odometry's pose; a sample of their beams, whose column `ping` counts the rows of placed; ground
    truth.
    """

    topics: list[Topic]
    chosen: ChosenTopics
    parameters: dict[str, Any]  # that the bag was read with
    odometry: Table
    pings: Table
    placed: Table
    beams: Table
    ground_truth: Table
    refused: dict[str, Refused] = field(default_factory=dict)
    mounts: list[Mount] = field(default_factory=list)
    links: list[tuple[str, str]] = field(default_factory=list)  # parent and child in tf
    noted: list[Noted] = field(default_factory=list)

    def beam_stamps(self) -> np.ndarray:
        """The stamp of each sampled beam."""
        return self.placed["stamp_s"][self.beams["ping"].astype(int)]


def topics_from(text: str) -> list[Topic]:
    """The topics as rbpf_inspect_bag tells them."""
    return [Topic(**topic) for topic in json.loads(text)["topics"]]


def load_facts(
    folder: Path, topics: list[Topic], chosen: ChosenTopics, parameters: dict[str, Any]
) -> Facts:
    """The files that rbpf_inspect_bag has written."""
    said = json.loads((folder / "facts.json").read_text(encoding="utf-8"))
    tables = {
        name: dict(zip(columns, np.load(folder / f"{name}.npy").T))
        for name, columns in said["columns"].items()
    }
    mounts = [
        Mount(mount["frame"], *(mount.get(key) for key in ("translation_m", "roll_pitch_yaw_rad")))
        for mount in said["mounts"]
    ]
    refused = {name: Refused(**count) for name, count in said["refused"].items()}
    return Facts(
        topics,
        chosen,
        parameters,
        **tables,
        refused=refused,
        mounts=mounts,
        links=[(parent, child) for parent, child in said["links"]],
        noted=[Noted(**noted) for noted in said["findings"]],
    )
