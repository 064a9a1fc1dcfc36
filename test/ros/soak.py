#!/usr/bin/env python3
"""A live survey, played four times as fast, under faults that a seed draws.

Processes are killed and stopped, strangers send rubbish. In the end the survey must be the one that
its journal gives, every ping that was lost must have come while the core was down, and nobody may
have stood still.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Callable

import numpy as np
import rosbag
import rosgraph
import rospy
import yaml
from geometry_msgs.msg import PoseArray
from nav_msgs.msg import Odometry
from rubbish import is_answered, rubbish_request, rubbish_sender
from sensor_msgs.msg import PointCloud2
from scipy.spatial.transform import Rotation
from soak_memory import Memory, programs
from std_srvs.srv import Trigger

from rbpf_svgp_slam import _journal, srv
from rbpf_svgp_slam.msg import FilterStatus, MapStatus
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.recorder.survey_client import fetch_survey, finish_survey

RATE = 4.0  # times real time
MISSION, MISSION_MIN = "lolo2", 135.0  # as long as it is at scale 1
PAUSE_S = (5.0, 15.0)  # between two faults, after all have recovered from the first
STOPPED_S = (1.0, 12.0)
RUBBISH = 40  # messages, or requests
PATIENCE_S = 120.0  # with what must happen; reached only by a bug
MAPS_PATIENCE_S = 1800.0  # with what takes as long as the survey is
ON_ITS_WAY_S = 0.5  # of a status, from before the fault
QUIET_END_S = 30.0  # without new faults, before the bag's end
WAITING_S = 1.0  # of a ping for odometry, at most
OVERLAY = {
    # a process that has stood still may have the pings before it has the player's clock
    "clock": {"max_ahead_s": 2.0 * RATE * STOPPED_S[1]},
    "particles": 12,
    "nodes": 2,
    "svgp": {"inducing_points": 100},
    "lc": {"rate_hz": 0.5},
    "resampling": {"threshold": 0.9},
    "output": {"final_training_s": 1.0, "figures": False},
}
RECORDER = "survey_recorder"
# What the journal and get_pings have under one name.
SAME = "stamp_s estimate online online_covariance dead_reckoning held_out levelled".split()


@dataclass
class Fault:
    """One, and when the survey went on as before."""

    what: str
    name: str
    at_s: float  # wall clock
    survey_s: float  # the survey's clock
    recovered_s: float = np.nan
    survey_recovered_s: float = np.nan


class Survey:
    """What the nodes say of themselves."""

    def __init__(self) -> None:
        self.status: FilterStatus | None = None
        self.particles: PoseArray | None = None
        self.heard_s: dict[str, float] = {}
        self._epochs: dict[str, int] = {}
        rospy.Subscriber(names.FILTER_STATUS, FilterStatus, self._on_status)
        rospy.Subscriber(f"{names.CORE}/particles", PoseArray, self._on_particles)
        for k in range(OVERLAY["nodes"]):
            name = names.map_node(k)
            rospy.Subscriber(names.map_status(k), MapStatus, self._on_map_status, name)

    def goes_on(self, since_s: float, pings: int) -> bool:
        """Pings are taken in, and every map node has followed."""
        status = self.status
        return (
            self.heard_s[names.CORE] > since_s
            and status.pings > pings
            and all(self.heard_s.get(name, 0.0) > since_s for name in map_nodes())
            and all(self._epochs[name] == status.epoch for name in map_nodes())
        )

    def _on_status(self, status: FilterStatus) -> None:
        self.status = status
        self.heard_s[names.CORE] = time.monotonic()

    def _on_particles(self, particles: PoseArray) -> None:
        self.particles = particles

    def _on_map_status(self, status: MapStatus, name: str) -> None:
        self._epochs[name] = status.epoch
        self.heard_s[name] = time.monotonic()


def map_nodes() -> list[str]:
    return [names.map_node(k) for k in range(OVERLAY["nodes"])]


def wait_for(condition: Callable[[], bool], what: str, patience_s: float = PATIENCE_S) -> None:
    give_up_s = time.monotonic() + patience_s
    while not condition():
        if time.monotonic() > give_up_s:
            raise TimeoutError(f"waited {patience_s:.0f} s in vain for {what}")
        time.sleep(0.1)


@dataclass
class Faults:
    """Dealt from a deck that has each once, and is shuffled again when it is empty.

    So no process is killed five times within a minute, when it would be given up.
    """

    launch: int  # its process
    survey: Survey
    rng: np.random.Generator
    spared: list[str]  # names that are not killed
    made: list[Fault] = field(default_factory=list)
    _deck: list[tuple[Callable[[str], None], str]] = field(default_factory=list)

    def make(self) -> None:
        """One, and wait until all is well again."""
        make, name = self._draw()
        fault = Fault(make.__name__.strip("_"), name, time.monotonic(), rospy.get_time())
        pings = self.survey.status.pings
        make(name)
        self.made.append(fault)
        since_s = time.monotonic() + ON_ITS_WAY_S
        what = f"the survey to go on after: {fault.what} {name}"
        wait_for(lambda: self.survey.goes_on(since_s, pings), what)
        fault.recovered_s, fault.survey_recovered_s = time.monotonic(), rospy.get_time()

    def kills_of(self, name: str) -> list[Fault]:
        """So far."""
        return [fault for fault in self.made if (fault.what, fault.name) == ("kill", name)]

    def _draw(self) -> tuple[Callable[[str], None], str]:
        if not self._deck:
            nodes = [names.CORE, *map_nodes()]
            self._deck = [(self._kill, name) for name in nodes if name not in self.spared]
            self._deck += [(self._stop, name) for name in (*nodes, RECORDER)]
            self._deck += [(self._send, "rubbish"), (self._ask, "rubbish")]
            self.rng.shuffle(self._deck)
        return self._deck.pop()

    def _kill(self, name: str) -> None:
        programs(self.launch)[name].kill()

    def _stop(self, name: str) -> None:
        process = programs(self.launch)[name]
        process.suspend()
        time.sleep(self.rng.uniform(*STOPPED_S))
        process.resume()

    def _send(self, _: str) -> None:
        """Damaged copies of what comes in just now."""
        for topic, kind in (("/odom", Odometry), ("/mbes/pings", PointCloud2)):
            whole = rospy.wait_for_message(topic, kind, PATIENCE_S)
            publishers: list[rospy.Publisher] = []

            def advertise(sent: type, topic: str = topic) -> rospy.Publisher:
                publishers.append(rospy.Publisher(topic, sent, queue_size=RUBBISH))
                return publishers[0]

            send = rubbish_sender(whole, advertise, self.rng)
            wait_for(publishers[0].get_num_connections, f"subscribers of {topic}")
            for _ in range(RUBBISH):
                send(rospy.get_time())
                time.sleep(0.02)
            publishers[0].unregister()

    def _ask(self, _: str) -> None:
        """Absurd requests."""
        services = {names.GET_BEAMS: srv.GetBeams, names.GET_MINIBATCHES: srv.GetMinibatches}
        services[names.GET_PINGS] = srv.GetPings
        for name in map_nodes():
            services[f"{name}/predict"] = srv.PredictBeams
            services[f"{name}/get_maps"] = srv.GetMaps
        for name, kind in services.items():
            call = rospy.ServiceProxy(name, kind)
            for _ in range(RUBBISH // len(services)):
                # a node never answers one that is cut off
                is_answered(call, rubbish_request(kind._request_class, self.rng, cut_share=0.0))


def play(bag: Path, log: Path) -> subprocess.Popen:
    """As replay.launch does it."""
    command = ["rosrun", "rbpf_svgp_slam", "play_survey.py", str(bag), "--rate", str(RATE)]
    command += ["--odometry", "/odom", "--pings", "/mbes/pings", "--ground-truth", "/ground_truth"]
    with log.open("w") as output:
        return subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)


def differences(served, survey: Survey, journal: dict) -> list[str]:
    """What the core serves, and its journal does not give, to the bit.

    Weights are served by what they make of the particles: their mean histories, and how many there
    are in effect.
    """
    different = [
        name
        for name in SAME
        if np.asarray(getattr(served, name)).tobytes()
        != np.asarray(journal[name], dtype=getattr(served, name).dtype).tobytes()
    ]
    positions = np.array([(p.position.x, p.position.y) for p in survey.particles.poses])
    if positions.tobytes() != journal["particles"][:, :2].tobytes():
        different.append("particles")
    turns = [(q.x, q.y, q.z, q.w) for q in (p.orientation for p in survey.particles.poses)]
    yaw_rad = Rotation.from_quat(turns).as_euler("ZYX")[:, 0]
    if np.abs(np.sin((yaw_rad - journal["particles"][:, 2]) / 2.0)).max() > 1e-9:
        different.append("the particles' yaw")
    weights = np.exp(journal["log_weights"])
    if abs(weights.sum() ** 2 / np.sum(weights**2) / survey.status.n_eff - 1.0) > 1e-9:
        different.append("weights")
    if journal["resamplings"] != survey.status.epoch:
        different.append("resamplings")
    return different


def last_prompt() -> str:
    """The core's answer, once no other prompt's resampling is under way."""
    answers: list[str] = []

    def is_weighed() -> bool:
        answer = rospy.ServiceProxy(f"{names.CORE}/prompt", Trigger)()
        answers.append(answer.message)
        return answer.success or "vetoed" in answer.message or "weighed already" in answer.message

    wait_for(is_weighed, "a prompt at the end")
    return answers[-1]


def lost_pings(bag: Path, served_s: np.ndarray, kills: list[Fault]) -> tuple[list[int], int]:
    """Pings of the bag that the survey lacks: by kill of the core, and how many came otherwise."""
    with rosbag.Bag(str(bag)) as file:
        pings = file.read_messages("/mbes/pings")
        stamps_s = np.array([message.header.stamp.to_sec() for _, message, _ in pings])
    lost_s = stamps_s[~np.isin(stamps_s, served_s)]
    lost = []
    for fault in kills:
        during = (lost_s > fault.survey_s - WAITING_S) & (lost_s < fault.survey_recovered_s)
        lost.append(int(np.count_nonzero(during)))
        lost_s = lost_s[~during]
    return lost, len(lost_s)


def told(faults: list[Fault]) -> list[str]:
    """A table."""
    lines = ["| fault | times | s until all went on: median, longest |", "|---|---|---|"]
    for what, name in sorted({(fault.what, fault.name) for fault in faults}):
        took_s = [f.recovered_s - f.at_s for f in faults if (f.what, f.name) == (what, name)]
        lines.append(
            f"| {what} {name} | {len(took_s)} | {np.median(took_s):.1f}, {max(took_s):.1f} |"
        )
    return lines


class Soak:
    """One run; see run()."""

    def __init__(self, folder: Path, minutes: float, seed: int, spared: list[str]) -> None:
        self._folder = folder
        self._spared = spared
        self._bag = folder / "survey.bag"
        self._out = folder / "run"
        self._rng = np.random.default_rng(seed)
        simulate = ["rosrun", "rbpf_svgp_slam", "simulate_survey.py", "--mission", MISSION]
        simulate += ["--scale", str(minutes / MISSION_MIN), "--duration", str(60.0 * minutes)]
        simulate += ["--seed", str(seed)]
        subprocess.run([*simulate, "--out", str(self._bag)], check=True, stdout=subprocess.DEVNULL)
        (folder / "soak.yaml").write_text(yaml.safe_dump(OVERLAY))

    def run(self) -> list[str]:
        """What was not as it should be."""
        rospy.set_param("/use_sim_time", True)
        rospy.init_node("soak", disable_signals=True)
        command = ["rosrun", "rbpf_svgp_slam", "run_launch.py", "slam.launch", f"out:={self._out}"]
        for name, file in (("config", "soak.yaml"), ("survey", "survey.survey.yaml")):
            command.append(f"{name}:={self._folder / file}")
        with (self._folder / "launch.log").open("w") as log:
            launch = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
        try:
            return self._survive(launch)
        finally:
            if launch.poll() is None:
                launch.terminate()
                launch.wait()

    def _survive(self, launch: subprocess.Popen) -> list[str]:
        survey = Survey()
        is_there = {names.CORE, RECORDER, *map_nodes()}.issubset
        wait_for(lambda: survey.status and is_there(programs(launch.pid)), "the nodes")
        player = play(self._bag, self._folder / "player.log")
        memory = Memory(launch.pid, rospy.get_time)
        faults = Faults(launch.pid, survey, self._rng, self._spared)
        try:
            self._make_faults(faults, player)
            wait_for(lambda: player.poll() is not None, "the bag's end")
        finally:
            player.terminate()
            player.wait()
            memory.stop()
        print("\n".join([*told(faults.made), "", *memory.rows(), ""]), flush=True)
        return self._end(launch, survey, faults)

    def _make_faults(self, faults: Faults, player: subprocess.Popen) -> None:
        with rosbag.Bag(str(self._bag)) as bag:
            last_s = bag.get_end_time() - QUIET_END_S * RATE
        while True:
            time.sleep(self._rng.uniform(*PAUSE_S))
            if player.poll() is not None or rospy.get_time() > last_s:
                return
            faults.make()

    def _end(self, launch: subprocess.Popen, survey: Survey, faults: Faults) -> list[str]:
        def maps_are_ready() -> bool:
            return survey.status.maps_ready == OVERLAY["particles"]

        wait_for(maps_are_ready, "all maps to be ready", MAPS_PATIENCE_S)
        prompt = last_prompt()
        finish_survey(survey.status.survey)
        heard_s = time.monotonic()
        wait_for(lambda: survey.heard_s[names.CORE] > heard_s + 2.0, "the last status")
        served = fetch_survey()
        journal = _journal.read(str(self._out / names.JOURNAL))
        different = differences(served, survey, journal)
        kills = faults.kills_of(names.CORE)
        lost, unexplained = lost_pings(self._bag, served.stamp_s, kills)
        rospy.ServiceProxy(f"{RECORDER}/save", Trigger)()
        status = launch.wait(MAPS_PATIENCE_S)  # the report
        restarts = sum(len(faults.kills_of(name)) for name in map_nodes())
        print(
            f"{len(served.stamp_s)} pings, {len(served.levelled)} beams, {survey.status.prompts} "
            f"prompts, {survey.status.epoch} resamplings, {survey.status.past} corrections of the "
            f"past; pings lost by kills of the core: {lost}\n"
            f"journal: {journal['records']} records by {journal['programs']} programs, "
            f"{journal['whole_bytes'] / 1e6:.0f} MB\na last prompt: {prompt}"
        )
        health = json.loads((self._out / "report.json").read_text())["health"]
        checks = {
            f"unlike its journal: {', '.join(different)}": not different,
            f"{unexplained} pings lost while the core was well": unexplained == 0,
            f"the launch ended with {status}": status == 0,
            f"health: {health}": health["core_resumed"] == len(kills)
            and health["map_nodes_restarted"] == restarts,
        }
        return [problem for problem, is_good in checks.items() if not is_good]


def main() -> int:
    """Exit status 1 if something was not as it should be."""
    parser = argparse.ArgumentParser(prog="tools/soak.sh", description=__doc__)
    add = parser.add_argument
    add("minutes", nargs="?", type=float, default=120.0, help="of survey (default %(default)g)")
    add("--seed", type=int, default=0, help="of the survey and its faults")
    add(
        "--spare",
        nargs="+",
        default=[],
        choices=[names.CORE, *map_nodes()],
        metavar="NAME",
        help="nodes that are never killed: their memory is seen to grow over the whole survey",
    )
    add("--folder", type=Path, help="where bag, logs and run folder are kept")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = (options.folder or Path(scratch)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        soak = Soak(folder, options.minutes, options.seed, options.spare)
        port = rosgraph.get_master_uri().rsplit(":", 1)[1].strip("/")
        with subprocess.Popen(["roscore", "-p", port], stdout=subprocess.DEVNULL) as master:
            try:
                wait_for(rosgraph.is_master_online, "the ROS master")
                problems = soak.run()
            finally:
                master.terminate()
    print("\n".join(problems) or "The survey is the one that its journal gives.")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
