"""What the camera box takes: its peak resident memory, and the time from the start of the process to the first pose at
a reader on DDS. PC build, simulated machine on loopback."""
import argparse
import os
import re
import shutil
import subprocess
import tempfile
import threading
import time

import package_world as world

# Also while it records and the disk stalls: the recorder then holds up to 4 images (Recorder::kBuffers).
MEMORY_LIMIT_MB = 48.0  # of 2^20 bytes, as the kernel and systemd count
# A functional limit: camera opened, packet size found, inclinometers asked, readers discovered.
FIRST_POSE_LIMIT_S = 5.0
MEASURED_S = 6.0
DOMAIN = "162"


class Reader(threading.Thread):
    """`tbm watch` into a pipe; when the first good pose came."""

    def __init__(self, tbm):
        super().__init__(daemon=True)
        self.process = subprocess.Popen([tbm, "watch", "--domain", DOMAIN], stdout=subprocess.PIPE, text=True)
        self.first_pose_at = None
        self.poses = 0
        self.start()

    def run(self):
        for line in self.process.stdout:
            if line.startswith("relative_pose") and " status=ok" in line:
                self.first_pose_at = self.first_pose_at or time.monotonic()
                self.poses += 1


def configuration(source, folder, records):
    """The example, in a domain of this test's own."""
    with open(f"{source}/pose/app/example/camera_box.yaml", encoding="utf-8") as file:
        text = file.read()
    for old, new in (("domain: 25", f"domain: {DOMAIN}"), ("limit_mb: 2000", "limit_mb: 100"),
                     ("# folder: runs", "folder: runs" if records else "# folder: runs")):
        if old not in text:
            raise SystemExit(f"FAILED: the example configuration has no '{old}'")
        text = text.replace(old, new)
    with open(f"{folder}/camera_box.yaml", "w", encoding="utf-8") as file:
        file.write(text)
    shutil.copy(f"{source}/pose/app/example/rig.yaml", folder)


def wait_for(condition, seconds):
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.05)
    return condition()


def memory_mb(process, name):
    with open(f"/proc/{process.pid}/status", encoding="utf-8") as file:
        return int(re.search(rf"{name}:\s*(\d+) kB", file.read()).group(1)) / 1024


def measure(checks, arguments, folder, processes, records):
    simulator = subprocess.Popen([arguments.tbm_sim, "--rig", "rig.yaml"], cwd=folder, stdout=subprocess.PIPE, text=True)
    processes.append(simulator)
    checks.that(any(line.startswith("ready") for line in simulator.stdout), "the simulated machine runs")
    reader = Reader(arguments.tbm)
    processes.append(reader.process)
    time.sleep(1.0)
    began = time.monotonic()
    with open(f"{folder}/log", "w", encoding="utf-8") as log:
        box = subprocess.Popen([arguments.camera_box, "camera_box.yaml"], cwd=folder, stderr=log)
    processes.append(box)
    has_come = wait_for(lambda: reader.first_pose_at, 30.0)
    with open(f"{folder}/log", encoding="utf-8") as log:
        checks.that(has_come, "poses come", log.read())
    if not has_come:
        return
    first_pose_s = reader.first_pose_at - began
    time.sleep(MEASURED_S)
    peak_mb = memory_mb(box, "VmHWM")
    limit_mb = MEMORY_LIMIT_MB if records else MEMORY_LIMIT_MB
    print(f"figure: {'recording' if records else 'measuring'}: peak resident memory {peak_mb:.1f} MB (wanted "
          f"{limit_mb:.0f}), of it {memory_mb(box, 'RssFile'):.1f} MB of files; first pose after {first_pose_s:.2f} s "
          f"(wanted {FIRST_POSE_LIMIT_S:.0f})")
    checks.that(peak_mb <= limit_mb, f"at most {limit_mb:.0f} MB resident")
    checks.that(first_pose_s <= FIRST_POSE_LIMIT_S, f"first pose within {FIRST_POSE_LIMIT_S:.0f} s")
    checks.that(reader.poses > 2 * MEASURED_S, f"poses go on: {reader.poses}")
    checks.equal(os.path.isdir(f"{folder}/runs"), records, "recording is as configured")


def main():
    parser = argparse.ArgumentParser()
    for name in ("--source", "--camera-box", "--tbm-sim", "--tbm"):
        parser.add_argument(name, required=True)
    arguments = parser.parse_args()
    checks = world.Checks()
    for records in (False, True):
        processes = []
        with tempfile.TemporaryDirectory() as folder:
            configuration(arguments.source, folder, records)
            try:
                measure(checks, arguments, folder, processes, records)
            finally:
                for process in reversed(processes):
                    process.terminate()
                    process.wait()
    checks.end()


if __name__ == "__main__":
    main()
