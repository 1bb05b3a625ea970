#!/usr/bin/env python3
"""A component that says how long its text is: the protocol of docs/protocol.md by hand."""

import json
import os
import socket
import sys
import threading
import zlib

PROFILE = {
    "name": "keeper",
    "about": "Keeps a text.",
    "inputs": [],
    "outputs": [],
    "parameters": [{"name": "text", "about": "what it keeps", "default": ""}],
}

if "--describe" in sys.argv:
    print(json.dumps(PROFILE))
    sys.exit(0)

system, name = os.environ["SDR_COMPONENT"].split("/")
agent = socket.socket(socket.AF_UNIX)
agent.connect(os.environ["SDR_SOCKET"])
speaking = threading.Lock()
now = {"state": "created", "token": None, "fault": None}


def say(kind, **fields):
    line = json.dumps({"type": kind, **fields}) + "\n"
    with speaking:
        agent.sendall(line.encode())


def beat():
    while not ended.wait(0.1):
        say("beat", ticks=0, late=0, period_worst_ns=0, execute_worst_ns=0)


ended = threading.Event()
component = {"system": system, "name": name, "scope": None}
instance = int(os.environ["SDR_INSTANCE"])
say("hello", v=1, component=component, instance=instance, pid=os.getpid(), profile=PROFILE, now=now)
threading.Thread(target=beat, daemon=True).start()
for line in agent.makefile("r", encoding="utf-8"):
    message = json.loads(line)
    if message["type"] == "configure":
        text = message["parameters"]["text"].encode()
        print(f"{len(text)} bytes, {zlib.crc32(text):08x}", flush=True)
        now["state"] = "inactive"
    elif message["type"] == "command":
        order = message["do"]
        now["token"] = message["token"] if order == "activate" else None
        now["state"] = {"activate": "active", "finish": "finalized"}.get(order, "inactive")
    say("state", **now)
    if now["state"] == "finalized":
        ended.set()
        sys.exit(0)
