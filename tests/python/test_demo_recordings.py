"""The recordings that the end-to-end run of the demo left are whole, and open elsewhere."""

import os
import pathlib

import pytest
from conftest import read

TOPICS = ("metrics", "components", "connections", "outputs", "events")
COMPONENTS = {"fisheye", "anomaly", "camera", "controller", "position"}
CONNECTIONS = 5


@pytest.fixture(scope="module")
def recordings():
    """robot -> topic -> messages, of the last end-to-end run."""
    folder = os.environ.get("SDR_TEST_RECORDINGS")
    assert folder, "SDR_TEST_RECORDINGS is not set: start these tests by ./test.sh python"
    paths = sorted(pathlib.Path(folder).rglob("*.mcap"))
    assert paths, f"no recordings in {folder}: ./test.sh tests leaves them there"
    found = {}
    for path in paths:
        for topic, messages in read(path).items():
            found.setdefault(topic, []).extend(message for _, message in messages)
    return found


def of(recordings, topic):
    return [
        message
        for path, messages in recordings.items()
        if path.startswith("/sdr/") and path.endswith(f"/{topic}")
        for message in messages
    ]


@pytest.mark.parametrize("topic", TOPICS)
def test_every_kind_of_message_is_there_and_can_be_read(recordings, topic):
    assert of(recordings, topic)


def test_three_robots_told_their_figures(recordings):
    robots = {message.robot for message in of(recordings, "metrics")}
    assert robots == {"robot-1", "robot-2", "robot-3"}


def test_all_five_components_were_active(recordings):
    seen = of(recordings, "components")
    active = {message.component for message in seen if message.state == "active"}
    assert active == COMPONENTS


def test_the_moved_components_were_active_on_two_robots(recordings):
    for component in ("fisheye", "anomaly"):
        homes = {
            message.robot
            for message in of(recordings, "components")
            if message.component == component and message.state == "active"
        }
        assert homes == {"robot-1", "robot-3"}


def test_every_connection_carried_samples(recordings):
    heard = {
        message.connection for message in of(recordings, "connections") if message.accepted > 0
    }
    assert len(heard) == CONNECTIONS


def test_every_number_of_an_event_has_a_name(recordings):
    for message in of(recordings, "events"):
        assert len(message.number_names) == len(message.number_values)
