"""What the core has refused of a survey, by reason."""

from __future__ import annotations

from rbpf_svgp_slam.msg import FilterStatus


def refusals(status: FilterStatus) -> dict[str, dict[str, object]]:
    """Count and first example by reason, the most frequent first."""
    rows = sorted(
        zip(status.refusal_reasons, status.refusal_counts, status.refusal_examples),
        key=lambda row: -row[1],
    )
    return {reason: {"count": int(n), "first": example} for reason, n, example in rows}


def nothing_taken_in(status: FilterStatus) -> str:
    """Why a survey has no ping: what was refused, how often, and the first case of each reason."""
    lines = [
        f"of {status.odometry_messages} odometry messages and all pings, no ping was taken in",
        *(
            f"  {row['count']} x {reason}; the first: {row['first']}"
            for reason, row in refusals(status).items()
        ),
    ]
    if len(lines) == 1:
        lines.append("  nothing was refused: no ping has come")
    return "\n".join([*lines, *(f"  {finding}" for finding in status.findings)])
