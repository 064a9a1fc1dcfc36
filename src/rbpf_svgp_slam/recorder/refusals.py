"""What the core has refused of a survey, by reason."""

from __future__ import annotations

from typing import Sequence

from rbpf_svgp_slam.msg import FilterStatus

#: Pings that are lost though nothing is wrong with them; see FilterStatus.
DROPPED = tuple(
    f"pings/{reason}"
    for reason in ("no_mount", "no_odometry", "queue_full", "mapping_paused", "survey_over")
)


def over_lives(values: Sequence[int]) -> int:
    """What a counter has come to that falls where its process has been started again.

    values: one after the other. A process that remembers its count does not let it fall.
    """
    return sum(int(now - was if now >= was else now) for was, now in zip((0, *values), values))


def refusals(statuses: Sequence[FilterStatus]) -> dict[str, dict[str, object]]:
    """Count and first example by reason, the most frequent first; statuses: of all the survey."""
    series = [dict(zip(s.refusal_reasons, s.refusal_counts)) for s in statuses]
    first: dict[str, str] = {}
    for status in statuses:
        for reason, example in zip(status.refusal_reasons, status.refusal_examples):
            first.setdefault(reason, example)
    count = {reason: over_lives([s.get(reason, 0) for s in series]) for reason in first}
    return {
        reason: {"count": count[reason], "first": first[reason]}
        for reason in sorted(first, key=lambda reason: -count[reason])
    }


def nothing_taken_in(statuses: Sequence[FilterStatus]) -> str:
    """Why a survey has no ping: what was refused, how often, and the first case of each reason."""
    last = statuses[-1]
    lines = [
        f"of {last.odometry_messages} odometry messages and all pings, no ping was taken in",
        *(
            f"  {row['count']} x {reason}; the first: {row['first']}"
            for reason, row in refusals(statuses).items()
        ),
    ]
    if len(lines) == 1:
        lines.append("  nothing was refused: no ping has come")
    return "\n".join([*lines, *(f"  {finding}" for finding in last.findings)])
