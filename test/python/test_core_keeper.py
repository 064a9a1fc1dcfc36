"""A core that is killed is started again with its journal; one that ends by itself is not."""

import signal
import subprocess
import sys
import time

import pytest

from rbpf_svgp_slam.keeper import core_keeper

#: Runs `keep` in a process of its own, which may be interrupted.
KEEP = (
    "import sys; from rbpf_svgp_slam.keeper.core_keeper import keep; sys.exit(keep(sys.argv[1:]))"
)


def shell(script):
    """A stand-in for the core: $@ is what it is given."""
    return ["sh", "-c", script, "core"]


@pytest.fixture(autouse=True)
def handlers():
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def test_a_core_that_ends_by_itself_is_not_started_again(tmp_path):
    for status in (0, 3):
        log = tmp_path / f"{status}"
        assert core_keeper.keep(shell(f"echo run >>{log}; exit {status}")) == status
        assert log.read_text() == "run\n"


def test_a_core_that_is_killed_resumes(tmp_path, capfd):
    log = tmp_path / "runs"
    script = f'echo "$@" >>{log}; [ "$1" = _resume:=true ] && exit 0; kill -9 $$'
    assert core_keeper.keep(shell(script)) == 0
    assert log.read_text() == "\n_resume:=true\n"
    assert "rbpf_core was killed by SIGKILL: it is started again" in capfd.readouterr().out


def test_a_core_that_dies_again_and_again_is_given_up():
    message = core_keeper.keep(shell("kill -11 $$"))
    assert message == "rbpf_core was killed by SIGSEGV, 5 times within 60 s: it is given up"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_is_passed_on_and_ends_both(tmp_path, number):
    log = tmp_path / "log"
    script = f"trap 'echo interrupted >>{log}; exit 0' INT; echo up >>{log}; while :; do :; done"
    keeper = subprocess.Popen([sys.executable, "-c", KEEP, *shell(script)])
    deadline_s = time.monotonic() + 20.0
    while not (log.exists() and log.read_text()) and time.monotonic() < deadline_s:
        time.sleep(0.02)
    keeper.send_signal(number)
    assert keeper.wait(20.0) == 0
    assert log.read_text() == "up\ninterrupted\n"


def test_the_core_does_not_outlive_a_keeper_that_is_killed(tmp_path):
    log = tmp_path / "pid"
    keeper = subprocess.Popen(
        [sys.executable, "-c", KEEP, *shell(f"echo $$ >{log}; exec sleep 60")]
    )
    deadline_s = time.monotonic() + 20.0
    while not (log.exists() and log.read_text()) and time.monotonic() < deadline_s:
        time.sleep(0.02)
    keeper.kill()
    keeper.wait()
    core = int(log.read_text())
    while time.monotonic() < deadline_s and _is_alive(core):
        time.sleep(0.02)
    assert not _is_alive(core)


def _is_alive(pid):
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
