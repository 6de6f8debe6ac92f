#!/usr/bin/env python3
"""Time, memory and page size of a merge of many recordings, as docs/accuracy.md has them.

    scripts/merge_at_size.py TRACK FOLDER [COUNT...]

FOLDER: the output of `track batch ... --shard 1/1` of some recordings (a hundred). Their results are copied under COUNT other
names, each with another SHA-256 of the recording, so that none counts as a copy; keys and records of 16 shards are made to
match. That stands for measuring COUNT recordings, which would take COUNT / cores seconds and more; the merge does not read
recordings, so it does the same work. The measured quantities repeat, and so does the fit's input.
"""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SHARDS = 16
FILES = ["result.json", "points.csv", "report.html"]


def shard_of(name):
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big") % SHARDS + 1


def make(source, out, count):
    record = json.loads((source / "shards/1-of-1.json").read_text())
    measured = [r for r in record["recordings"] if r["key"]]
    (out / "results").mkdir(parents=True)
    (out / "shards").mkdir()
    shards = {i: [] for i in range(1, SHARDS + 1)}
    for i in range(count):
        origin = measured[i % len(measured)]
        name = f"clip-{i:06d}"
        sha256 = hashlib.sha256(name.encode()).hexdigest()
        key = dict(origin["key"], input_sha256=sha256)
        digests = {}
        for file in FILES:
            data = (source / "results" / f"{origin['name']}.{file}").read_bytes()
            if file == "result.json":
                result = json.loads(data)
                result["video"]["sha256"] = sha256
                data = json.dumps(result, indent=2).encode() + b"\n"
            digests[file] = hashlib.sha256(data).hexdigest()
            (out / "results" / f"{name}.{file}").write_bytes(data)
        whole = dict(key, files_sha256=digests)
        (out / "results" / f"{name}.key.json").write_text(json.dumps(whole, indent=2) + "\n")
        shards[shard_of(name)].append(dict(origin, name=name, key=key))
    for i, recordings in shards.items():
        content = {
            "schema": record["schema"],
            "shard": {"index": i, "count": SHARDS},
            "finished": True,
            "given": {"count": count, "sha256": "made by merge_at_size.py"},
            "recordings": recordings,
        }
        (out / f"shards/{i}-of-{SHARDS}.json").write_text(json.dumps(content))


def main():
    track, source = sys.argv[1], Path(sys.argv[2])
    counts = [int(n) for n in sys.argv[3:]] or [1000, 3000, 10000]
    print("| recordings | merge / s | memory / MB | report.html / MB |\n|---|---|---|---|", flush=True)
    for count in counts:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "lab"
            make(source, out, count)
            started = time.monotonic()
            child = subprocess.Popen([track, "batch", "--merge", "--out", str(out)],
                                     stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
            errors = child.stderr.read()
            _, status, usage = os.wait4(child.pid, 0)
            took = time.monotonic() - started
            if os.waitstatus_to_exitcode(status) != 0:
                sys.stderr.write(errors.decode())
            page = (out / "report.html").stat().st_size
            print(f"| {count} | {took:.1f} | {usage.ru_maxrss / 1024:.0f} | {page / 1e6:.2f} |", flush=True)
            if "KEEP" in os.environ and count == counts[-1]:
                Path(os.environ["KEEP"]).write_bytes((out / "report.html").read_bytes())


main()
