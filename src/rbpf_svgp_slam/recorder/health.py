"""How a survey went: what was lost, refused, tried in vain and started again."""

from __future__ import annotations

from typing import Any

from rbpf_svgp_slam.recorder.recording import Recording
from rbpf_svgp_slam.recorder.refusals import DROPPED, over_lives, refusals


def health(recording: Recording, pings_lost: int) -> dict[str, Any]:
    """The group `health` of report.json; pings_lost: of the bag's, as far as that is known."""
    last = recording.statuses[-1]
    lives = recording.map_lives
    refused = {reason: row["count"] for reason, row in refusals(recording.statuses).items()}
    return {
        "pings_dropped": max(sum(refused.get(reason, 0) for reason in DROPPED), pings_lost),
        "refused": refused,
        "beams_rejected": int(last.beams_rejected),
        "ground_truth_refused": sum(recording.ground_truth.refused.values()),
        "prompts_vetoed": int(last.prompts_vetoed),
        "prompts_skipped": int(last.prompts_skipped),
        "prompts_failed": over_lives([status.prompts_failed for status in recording.statuses]),
        "resamplings_rolled_back": int(last.resamplings_failed),
        "training_steps_undone": sum(int(status.skipped_steps) for status in lives.values()),
        "core_resumed": int(last.resumed),
        "map_nodes_restarted": sum(int(m.restarts) for m in recording.map_statuses.values()),
        "journal": last.journal,
    }
