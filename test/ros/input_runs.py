"""Runs bag cases, offline or live, and holds what comes of them against what is expected."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import signal
import socket
import subprocess
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Callable, Iterator

import psutil
import yaml
from bag_cases.expected import Case, Expected
from bag_cases.survey import Survey, read_survey, write_survey

OFFLINE, LIVE = "offline", "live"
LAUNCH_FILES = {OFFLINE: "offline.launch", LIVE: "replay.launch"}
#: Of a replay, times real time: high, but with seconds left for what waits for wall time.
RATE = 15
#: Of a run, on a machine that does other things too; on an idle one it takes some ten seconds.
TIME_LIMIT_S = 120.0
MASTER_PORTS = 20_000, 32_768
#: For a launch that has been interrupted to end its nodes: roslaunch itself gives them 17 s.
END_S = 30.0
#: As little as there can be: what is looked at is the way in.
CONFIG = {
    "particles": 2,
    "nodes": 1,
    "mapping": {"hold_back_s": 5.0},
    "map": {"publish_period_s": 0.0, "resolution_m": 4.0},
    "svgp": {
        "inducing_points": 16,
        "minibatch_size": 50,
        "convergence": {"window": 20, "tolerance": 1.0},
    },
    "lc": {"rate_hz": 0.05},
    "offline": {"steps_per_second": 1.0},
    "output": {
        "final_training_s": 0.0,
        "publish_rate_hz": 5.0,
        "time_lapse_period_s": 0.0,
    },
}
#: Cases whose report is drawn: figures, too, must bear gaps and places far from the origin.
DRAWN = ("harmless_together", "utm_area_local")
#: DR's error of the base survey is 0.7 m. A case may begin somewhat later or lack a few messages,
#: but no wrong twist, sign or unit of a survey of 200 m stays below.
FAR_M = 2.5
#: Two particles with the noise of the motion model and no map worth the name wander off further.
FILTER_SHARE, FILTER_M = 3.0, 2.0
#: What roslaunch itself says at the end of every launch.
CHATTER = re.compile(
    r"killing on exit|shutting down|^done$|^\.\.\. |process\[|^setting |^started |^auto-starting"
    r"|^ROS_MASTER_URI|^\s*$"
)
COLOURS = re.compile(r"\x1b\[[0-9;]*m|\x1b\][^\x07]*\x07")
LAST_LINES = 14


@dataclass
class Run:
    """What is left of a launch."""

    status: int | None  # exit status; None: it had to be ended
    output: str
    wall_s: float
    report: dict[str, Any] | None = None

    @property
    def last_lines(self) -> str:
        """Without roslaunch's own words."""
        lines = COLOURS.sub("", self.output).replace("\r", "\n").splitlines()
        return "\n".join([line for line in lines if not CHATTER.search(line)][-LAST_LINES:])

    @property
    def refused(self) -> dict[str, dict[str, Any]]:
        return (self.report or {}).get("refused", {})

    @property
    def findings(self) -> list[str]:
        """Names, however the report lists them."""
        found = (self.report or {}).get("findings", [])
        return [one["name"] if isinstance(one, dict) else str(one).split(":")[0] for one in found]


@dataclass
class Workshop:
    """Bags and runs in one folder, made of one survey."""

    folder: Path
    time_limit_s: float = TIME_LIMIT_S
    base: Survey = field(init=False)

    def __post_init__(self) -> None:
        bag = self.folder / "base.bag"
        simulate = ["rosrun", "rbpf_svgp_slam", "simulate_survey.py", "--mission", "demo"]
        command = [*simulate, "--scale", "0.05", "--seed", "3", "--out", str(bag)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        self.base = read_survey(bag)
        for figures in (False, True):
            output = {**CONFIG["output"], "figures": figures}
            config = yaml.safe_dump({**CONFIG, "output": output})
            self.config(figures).write_text(config, encoding="utf-8")

    def config(self, figures: bool) -> Path:
        """The parameters, with and without a report's figures."""
        return self.folder / f"tiny_{'drawn' if figures else 'plain'}.yaml"

    def run(
        self,
        case: Case,
        mode: str,
        while_it_runs: Callable[[int], None] | None = None,
        rate: float = RATE,
    ) -> tuple[Survey, Run]:
        """The case's survey, and its run. while_it_runs: called with the launch's process id."""
        survey = case.make(self.base)
        out = self.folder / f"{case.name}_{mode}"
        out.mkdir(exist_ok=True)
        bag = out / f"{case.name}.bag"
        write_survey(survey, bag)
        # the nodes' own protection is looked at, not check_bag.py's before them
        config = self.config(case.name in DRAWN and mode == OFFLINE)
        arguments = [f"bag:={bag}", f"out:={out}", f"config:={config}", "check:=false"]
        arguments += [f"survey:={bag.with_suffix('.survey.yaml')}", *survey.arguments]
        if mode == LIVE:
            arguments.append(f"rate:={rate}")
        command = [LAUNCH_FILES[mode], *arguments]
        run = launch(command, self.time_limit_s, survey.namespace, while_it_runs)
        report = out / "report.json"
        if report.is_file():
            run.report = json.loads(report.read_text(encoding="utf-8"))
        return survey, run


def launch(
    arguments: list[str],
    time_limit_s: float = TIME_LIMIT_S,
    namespace: str = "",
    while_it_runs: Callable[[int], None] | None = None,
) -> Run:
    """A launch file on a master of its own, ended if it has not come to an end in time."""
    command = ["rosrun", "rbpf_svgp_slam", "run_launch.py", *arguments]
    environment = {**os.environ, "ROS_MASTER_URI": f"http://localhost:{_free_port()}"}
    if namespace:
        environment["ROS_NAMESPACE"] = namespace
    begin_s = time.monotonic()
    with tempfile.TemporaryFile("w+", errors="replace") as output:
        running = subprocess.Popen(
            command,
            stdout=output,
            stderr=subprocess.STDOUT,
            env=environment,
            start_new_session=True,  # Ctrl-C is for us, and we see to its end
        )
        try:
            if while_it_runs:
                while_it_runs(running.pid)
            status = running.wait(time_limit_s)
        except subprocess.TimeoutExpired:
            status = None
        finally:
            wall_s = time.monotonic() - begin_s
            _end(running)
        output.seek(0)
        return Run(status, output.read(), wall_s)


def _free_port() -> int:
    """Below those that the system hands out: else another run may have got it by the time."""
    while True:
        port = random.randrange(*MASTER_PORTS)
        with socket.socket() as one, contextlib.suppress(OSError):
            one.bind(("", port))
            return port


def _end(running: subprocess.Popen) -> None:
    """The launch and all that it has started."""
    if running.poll() is not None:
        return
    children = psutil.Process(running.pid).children(recursive=True)
    # not killed: roslaunch must take its nodes with it
    running.send_signal(signal.SIGINT)
    try:
        running.wait(END_S)
    except subprocess.TimeoutExpired:
        for process in [*children, psutil.Process(running.pid)]:
            if process.is_running():
                process.kill()
        running.wait()


def problems(case: Case, mode: str, survey: Survey, run: Run) -> list[str]:
    """What is not as expected; nothing if all is."""
    expected = case.offline if mode == OFFLINE else case.live
    if run.status is None:
        return [f"still running after {run.wall_s:.0f} s"]
    if expected.stops:
        return list(_problems_of_stop(expected, run))
    return list(_problems_of_report(expected, survey, run))


def _problems_of_stop(expected: Expected, run: Run) -> Iterator[str]:
    if run.status != 1:
        yield f"exit status {run.status}"
    if not re.search(expected.stops, run.last_lines, re.IGNORECASE):
        yield f"the last lines lack {expected.stops!r}"


def _problems_of_report(expected: Expected, survey: Survey, run: Run) -> Iterator[str]:
    if run.status != 0:
        yield f"exit status {run.status}"
    if re.search("REQUIRED process|process has died", run.output):
        yield "a process is said to have died"
    if run.report is None:
        yield "no report.json"
        return
    report = run.report
    yield from _problems_of_counts(expected, survey, run)
    if sorted(set(run.findings)) != sorted(expected.finds):
        yield f"findings {run.findings}, expected {list(expected.finds)}"
    for name, value in expected.report.items():
        if report.get(name) != value:
            yield f"{name} is {report.get(name)!r}, expected {value!r}"
    ate_m, dr_m = report["ate_rmse_m"], report["dr_ate_rmse_m"]
    if not expected.has_truth:
        if ate_m is not None:
            yield "an error without ground truth"
    elif ate_m is None:
        yield "no error in spite of ground truth"
    elif expected.is_near and (dr_m > FAR_M or ate_m > FILTER_SHARE * dr_m + FILTER_M):
        yield f"ATE {ate_m:.1f} m, of DR {dr_m:.1f} m"


def _problems_of_counts(expected: Expected, survey: Survey, run: Run) -> Iterator[str]:
    """Every message that is spoilt is refused, and no other."""
    others = set(run.refused) - set(expected.refused)
    if others:
        yield f"refused: {', '.join(sorted(others))}"
    if not expected.counts_are_known:
        return
    for kind in ("odometry", "pings"):
        of_kind = [row["count"] for name, row in run.refused.items() if name.startswith(kind)]
        if sum(of_kind) != survey.spoilt[kind]:
            yield f"{sum(of_kind)} {kind} refused, expected {survey.spoilt[kind]}"
    taken = len(survey.of(survey.ping_topic)) - survey.spoilt["pings"]
    if run.report["pings"] != taken:
        yield f"{run.report['pings']} pings taken in, expected {taken}"
