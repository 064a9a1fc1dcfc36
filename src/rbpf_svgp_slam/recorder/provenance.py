"""Where a run's numbers come from: for whoever finds its report years later."""

from __future__ import annotations

from datetime import datetime, timezone
from typing import Sequence

import rospkg

from rbpf_svgp_slam import machine

PACKAGE = "rbpf_svgp_slam"


def provenance(bag: str, stamp_s: Sequence[float], is_over: bool) -> dict[str, str]:
    """By what it is; bag: empty for a live run; stamp_s: of the pings so far; is_over: all."""
    return {
        "bag": bag or "none: recorded live",
        "survey_begin": _date(stamp_s[0]),
        "survey_end": _date(stamp_s[-1]) + ("" if is_over else ", still going on"),
        "written": _date(datetime.now(timezone.utc).timestamp()),
        "version": rospkg.RosPack().get_manifest(PACKAGE).version or "unknown",
        "commit": machine.commit(),
    }


def _date(stamp_s: float) -> str:
    return datetime.fromtimestamp(stamp_s, timezone.utc).isoformat(sep=" ", timespec="seconds")
