"""How long pings wait to be taken in while real map nodes train, on all of the machine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bench.core.ingest import NODES, core, sail

DURATION_S = 120.0


def run(out: Path) -> dict[str, Any]:
    """As core.ingest; both nodes train 50 maps each, by minibatches."""
    log = out / "ingest_training.log"
    with core(log, local_nodes=NODES, svgp={"optimizer": "adam"}) as statuses:
        figures = sail(statuses, DURATION_S)
        figures["steps"] = statuses[-1].iterations
    return {"ingest_training": figures}
