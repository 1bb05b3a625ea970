#!/usr/bin/env python3
"""A condition that no table can say: the battery falls faster than a share per minute.

Named in a recovery policy as

    rules:
      - cause: { exec: [battery_drop.py, "5"], every: 1s, causes: [battery-drop] }
        for: 10s
        ladder: elsewhere

and laid, executable, into a folder that `[components] path` of each robot names. It gets the
facts of docs/recovery.md as JSON on its standard input and answers with the causes it finds.
It is started anew each time, so what it must remember it keeps in a file.
"""

import json
import os
import sys
import time

WINDOW_S = 60.0


def samples_of_last_minute(path, now, battery):
    """Charges of the last minute with their times, the new one behind them."""
    try:
        with open(path, encoding="utf-8") as kept:
            samples = json.load(kept)
    except (OSError, ValueError):
        samples = []
    # A clock that was set back would leave samples of the future: they go, too.
    samples = [s for s in samples if 0.0 <= now - s[0] <= WINDOW_S]
    samples.append([now, battery])
    with open(path + ".new", "w", encoding="utf-8") as kept:
        json.dump(samples, kept)
    os.replace(path + ".new", path)
    return samples


def main():
    facts = json.load(sys.stdin)
    percent_per_minute = float(sys.argv[1]) if len(sys.argv) > 1 else 5.0
    folder = sys.argv[2] if len(sys.argv) > 2 else "/tmp"
    battery = facts["robot"]["battery"]
    causes = []
    if battery is not None:
        file = os.path.join(folder, f"battery_drop_{facts['robot']['name']}.json")
        samples = samples_of_last_minute(file, time.time(), battery)
        drop = (samples[0][1] - battery) * 100.0
        if drop >= percent_per_minute:
            reason = f"battery fell by {drop:.1f} % within a minute"
            for component in facts["components"]:
                causes.append({"component": component["name"], "reason": reason})
    json.dump({"causes": causes}, sys.stdout)


if __name__ == "__main__":
    main()
