"""What one agent records is read by a library that knows nothing of us."""

import math
import signal

from conftest import READY_WITHIN_S, read, wait_until


def test_rosbags_reads_the_figures_of_an_agent_that_was_ended(agent):
    wait_until_recorded(agent)

    assert agent.end(signal.SIGTERM) == 0

    figures = metrics(agent)
    assert all(figure.robot == "robot-1" for figure in figures)
    assert all(figure.memory_capacity_bytes == 1_900_000_000 for figure in figures)
    assert all(figure.memory_free_bytes <= 1_900_000_000 for figure in figures)
    assert all(figure.agent_rss_bytes > 0 for figure in figures)
    # No sensor: not a number, and never zero.
    assert all(math.isnan(figure.battery_percent) for figure in figures)


def test_rosbags_reads_what_a_killed_agent_left(agent):
    wait_until_recorded(agent)

    agent.end(signal.SIGKILL)

    assert metrics(agent)


def test_times_in_a_recording_never_go_back(agent):
    wait_until_recorded(agent)

    agent.end(signal.SIGTERM)

    own = [figure.monotonic_ns for figure in metrics(agent)]
    assert own == sorted(own)


def metrics(agent):
    (path,) = agent.recordings()
    return [message for _, message in read(path)["/sdr/robot_1/metrics"]]


def wait_until_recorded(agent):
    """Until some figures are in the file, and not only on their way."""

    def recorded():
        return any(path.stat().st_size > 4096 for path in agent.recordings())

    wait_until(recorded, READY_WITHIN_S, "figures are in the recording")
