"""What the tests share: a real agent, and recordings read back by rosbags."""

import os
import pathlib
import signal
import socket
import subprocess
import tempfile
import time

import pytest
from rosbags.highlevel import AnyReader

READY_WITHIN_S = 60
ENDED_WITHIN_S = 60

ROBOT_TOML = """
[robot]
name = "robot-1"
[capacity]
memory = "1.9GB"
[mesh]
unsealed = true
fleet = "python-tests"
listen = "127.0.0.1:{port}"
seeds = []
[api]
socket = "{folder}/agent.sock"
[storage]
state = "{folder}/state"
recordings = {{ dir = "{folder}/recordings" }}
"""


def free_port():
    """A UDP port that nobody has right now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_until(holds, within_s, what):
    """Waits for a condition, looking ten times a second."""
    limit = time.monotonic() + within_s
    while not holds():
        assert time.monotonic() < limit, f"still not so after {within_s} s: {what}"
        time.sleep(0.1)


class Agent:
    """One agent, alone in its fleet, with everything below one folder."""

    def __init__(self, program, folder):
        self.folder = pathlib.Path(folder)
        self.config = self.folder / "robot.toml"
        self.config.write_text(ROBOT_TOML.format(port=free_port(), folder=folder))
        self.log = self.folder / "agent.log"
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [program, "--config", str(self.config)], stdout=log, stderr=log
            )

    def ask(self, path):
        """The answer to a GET on the agent's socket, or None when nobody answers."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
            try:
                client.connect(str(self.folder / "agent.sock"))
            except OSError:
                return None
            client.sendall(f"GET {path} HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n".encode())
            answer = b""
            while more := client.recv(65536):
                answer += more
            return answer

    def wait_until_ready(self):
        def ready():
            assert self.process.poll() is None, self.log.read_text()
            return self.ask("/") is not None

        wait_until(ready, READY_WITHIN_S, "the agent answers")

    def end(self, sent):
        """Ends the agent by a signal and returns its exit status."""
        self.process.send_signal(sent)
        return self.process.wait(ENDED_WITHIN_S)

    def recordings(self):
        return sorted((self.folder / "recordings").glob("*.mcap"))


@pytest.fixture
def agent():
    program = os.environ.get("SDR_TEST_AGENT")
    assert program, "SDR_TEST_AGENT is not set: start these tests by ./test.sh python"
    # Short, since the path of a Unix socket has at most 107 bytes.
    with tempfile.TemporaryDirectory(prefix="sdr-") as folder:
        agent = Agent(program, folder)
        try:
            agent.wait_until_ready()
            yield agent
        finally:
            if agent.process.poll() is None:
                agent.end(signal.SIGKILL)


def read(path):
    """All messages of one recording as topic -> list of (log time, message).

    Types come from the schemas in the file alone: no store of ROS 2 types is given.
    """
    found = {}
    with AnyReader([pathlib.Path(path)]) as reader:
        for connection, log_time, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append((log_time, message))
    return found
