"""The camera box as the service that it is: Debian 12 with its own systemd as process 1, the package installed,
a simulated machine on its loopback network. The service publishes, is watched, comes back when it hangs or
dies, stops clean; log and memory are bounded.

The amd64 package stands for the armhf one: unit, scripts and configuration are the same files.
"""
import argparse
import glob
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import package_world as world

UNIT = "tbm-camera-box"
# Process 1 lives in namespaces and a control group of its own; nsenter takes tests to it.
BOOT = """
set -e
mount --make-rprivate /
mkdir -p "$1/../group_$2"
mount -t cgroup2 cgroup2 "$1/../group_$2"
mkdir -p "$1/../group_$2/tbm_test_$2"
echo $$ > "$1/../group_$2/tbm_test_$2/cgroup.procs"
umount "$1/../group_$2"
rmdir "$1/../group_$2"
exec unshare --pid --fork --mount --uts --ipc --cgroup --net --kill-child=SIGKILL sh -c '
  set -e
  mount --bind "$0" "$0"
  mount -t proc proc "$0/proc"
  # Most of these settings belong to the whole machine and not to the namespaces.
  mount --bind "$0/proc/sys" "$0/proc/sys"
  mount -o remount,bind,ro "$0/proc/sys"
  mount -t sysfs sysfs "$0/sys"
  mount -t cgroup2 cgroup2 "$0/sys/fs/cgroup"
  mount -t tmpfs -o mode=755 tmpfs "$0/run"
  mount -t tmpfs tmpfs "$0/tmp"
  mount -t tmpfs -o mode=755 tmpfs "$0/dev"
  for node in "null 1 3" "zero 1 5" "full 1 7" "random 1 8" "urandom 1 9" "tty 5 0"; do
    set -- $node
    mknod -m 666 "$0/dev/$1" c "$2" "$3"
  done
  mkdir "$0/dev/pts" "$0/dev/shm"
  mount -t devpts -o newinstance,ptmxmode=0666,mode=0620,gid=5 devpts "$0/dev/pts"
  ln -s pts/ptmx "$0/dev/ptmx"
  mount -t tmpfs tmpfs "$0/dev/shm"
  hostname camera-box
  exec env -i container=tbm-test PATH=/usr/sbin:/usr/bin:/sbin:/bin chroot "$0" /lib/systemd/systemd
' "$1"
"""
# Tests do not wait for ten seconds.
IMPATIENT = """[Service]
WatchdogSec=3
"""
SIMULATOR = """[Service]
Environment=LD_LIBRARY_PATH=/opt/lib
ExecStart=/opt/tbm_sim --rig /opt/rig.yaml --target-port /run/sim/target --camera-port /run/sim/camera
User=tbm-camera-box
RuntimeDirectory=sim
"""


class Machine:
    def __init__(self, root):
        self.log = open(f"{root}.console", "w+", encoding="utf-8")
        self.outer = subprocess.Popen(["sh", "-c", BOOT, "boot", root, str(os.getpid())], stdin=subprocess.DEVNULL,
                                      stdout=self.log, stderr=self.log)
        self.first = None
        self.root = root

    def wait_for_boot(self):
        self.first = eventually(self._first_process, 20)
        return self.first and eventually(lambda: self.run("systemctl", "is-system-running").strip()
                                         in ("running", "degraded"), 40)

    def _first_process(self):
        try:
            with open(f"/proc/{self.outer.pid}/task/{self.outer.pid}/children", encoding="utf-8") as file:
                child = file.read().split()[0]
            with open(f"/proc/{child}/comm", encoding="utf-8") as file:
                return child if file.read().strip() == "systemd" else None
        except (OSError, IndexError):
            return None

    def run(self, *command):
        done = subprocess.run(["nsenter", "--target", self.first, "--all", f"--root=/proc/{self.first}/root", "--",
                               *command], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, check=False)
        if done.returncode in (126, 127):
            sys.exit(f"FAILED: {done.stdout}")
        return done.stdout

    def send(self, name, process):
        self.run("sh", "-c", f"kill -{name} {process}")

    def show(self, name, unit=UNIT):
        return self.run("systemctl", "show", "--value", "-p", name, unit).strip()

    def journal(self):
        """What the present, or else the last, run of the service said, and systemd about it."""
        run = self.show("InvocationID")
        return self.run("journalctl", "--no-pager", "-o", "cat", f"_SYSTEMD_INVOCATION_ID={run}", "+", f"INVOCATION_ID={run}")

    def end(self):
        if self.outer.poll() is None:
            self.outer.send_signal(signal.SIGKILL)
        self.outer.wait()
        self.log.close()
        os.remove(f"{self.root}.console")


def eventually(condition, seconds):
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        value = condition()
        if value:
            return value
        time.sleep(0.2)
    return None


def prepare(box, root, package, simulator, source):
    box.install_dependencies(root, package)
    box.install(root, [package])
    shutil.copy(simulator, f"{root}/opt/tbm_sim")
    # What the simulator loads and the box does not: it is no package of this file system.
    os.makedirs(f"{root}/opt/lib")
    for line in world.run(["ldd", simulator]).splitlines():
        name, _, path = line.strip().partition(" => ")
        library = path.split(" (")[0]
        if library.startswith("/") and not glob.glob(f"{root}/usr/lib/*/{name}"):
            shutil.copy(library, f"{root}/opt/lib/{name}")
    shutil.copy(f"{source}/pose/app/example/rig.yaml", f"{root}/opt/rig.yaml")
    config = f"{root}/etc/tbm/camera_box.yaml"
    with open(config, encoding="utf-8") as file:
        text = file.read()
    text = text.replace("# folder: /var/lib/tbm/runs", "folder: /var/lib/tbm/runs")
    with open(config, "w", encoding="utf-8") as file:
        file.write(text)
    os.makedirs(f"{root}/etc/systemd/system/{UNIT}.service.d")
    for path, text in ((f"{UNIT}.service.d/impatient.conf", IMPATIENT), ("simulator.service", SIMULATOR)):
        with open(f"{root}/etc/systemd/system/{path}", "w", encoding="utf-8") as file:
            file.write(text)
    # The ports' names, which udev gives on a box.
    with open(f"{root}/etc/tmpfiles.d/ports.conf", "w", encoding="utf-8") as file:
        file.write("L /dev/tbm/tilt_target - - - - /run/sim/target\nL /dev/tbm/tilt_camera - - - - /run/sim/camera\n")


def came_back(machine, before):
    """Another process than `before`, and the service says that it is ready."""
    return eventually(lambda: machine.show("MainPID") not in ("0", before)
                      and machine.show("ActiveState") == "active", 25)


def has_poses(machine):
    """What the service has said of it last; it takes a second to say so."""
    time.sleep(2.5)
    return re.findall("code=no_pose active=(true|false)", machine.journal())[-1:] != ["true"]


def check_delivered_rig(checks, machine, root):
    eventually(lambda: "camera is streaming" in machine.journal(), 30)
    checks.that(not has_poses(machine), "with the rig as delivered there is no pose", machine.journal())
    shutil.copy(f"{root}/opt/rig.yaml", f"{root}/etc/tbm/rig.yaml")
    machine.run("systemctl", "restart", UNIT)


def check_service(checks, machine):
    is_active = eventually(lambda: machine.show("ActiveState") == "active", 30)
    checks.that(is_active, "the service is active", machine.run("systemctl", "status", UNIT) + machine.journal())
    checks.that(eventually(lambda: "camera is streaming" in machine.journal(), 20), "it has the camera", machine.journal())
    for word in ("target", "camera"):
        checks.that(eventually(lambda name=word: f"inclinometer_{name} is streaming" in machine.journal(), 10),
                    f"it has the serial port of the {word} inclinometer", machine.journal())
    checks.that(eventually(lambda: "recorder is streaming" in machine.journal(), 10), "it records", machine.journal())
    checks.that(has_poses(machine), "it has poses", machine.journal())
    process = machine.show("MainPID")
    checks.equal(machine.run("stat", "-c", "%U", f"/proc/{process}").strip(), UNIT, "its user")
    checks.equal(machine.run("cat", f"/proc/{process}/stat").rsplit(")", 1)[1].split()[16], "-10", "its priority")
    checks.equal(machine.run("stat", "-c", "%U %a", "/var/lib/tbm/runs").strip(), f"{UNIT} 750", "its folder")


def check_watch(checks, machine):
    process = machine.show("MainPID")
    machine.send("STOP", process)
    checks.that(came_back(machine, process), "a process that hangs is replaced by the watchdog", machine.journal())
    everything = machine.run("journalctl", "--no-pager", "-o", "cat", "-u", UNIT)
    checks.that("Watchdog timeout" in everything, "the journal says that it was the watchdog", everything)
    # systemd's own limit would be five starts in ten seconds.
    times = 0
    for _ in range(6):
        process = machine.show("MainPID")
        machine.send("KILL", process)
        times += 1 if came_back(machine, process) else 0
    checks.equal(times, 6, "killed six times in a row, it is started again each time")
    machine.run("systemctl", "stop", UNIT)
    checks.equal((machine.show("ActiveState"), machine.show("Result"), machine.show("ExecMainStatus")),
                 ("inactive", "success", "0"), "it stops clean")
    checks.that("code=ended" in machine.journal(), "it says that it ended", machine.journal())
    # As README.box.md tells the installer.
    said = machine.run("runuser", "-u", UNIT, "--", "camera_box", "--self-test", "/etc/tbm/camera_box.yaml",
                       "--seconds", "2")
    checks.that(re.search(r"^0 bad, \d+ doubtful\. The box works\.|^The box is ready\.", said, re.M),
                "the self-test as the service's user finds nothing bad", said)


def check_bounds(checks, machine):
    checks.equal(machine.run("systemctl", "cat", UNIT).count("WatchdogSec=10"), 1, "the watchdog's time as delivered")
    settings = machine.run("systemd-analyze", "cat-config", "systemd/journald.conf")
    checks.that("SystemMaxUse=64M" in settings, "the bound of the journal is read", settings)
    # What journald itself worked out, and says when it starts.
    usage = machine.run("journalctl", "--no-pager", "-o", "cat", "-u", "systemd-journald", "-t", "systemd-journald")
    checks.that("max 64.0M" in usage, "the bound of the journal is in force", usage)
    checks.equal(machine.show("MemoryMax"), str(128 << 20), "bound of memory")
    checks.equal(machine.show("StartLimitIntervalUSec"), "0", "no limit of starts")


def check_package(checks, box, machine, root, package):
    machine.run("systemctl", "start", UNIT)
    process = machine.show("MainPID")
    shutil.copy(package, f"{root}/opt/")
    output = machine.run("dpkg", "--force-confold", "-i", "/opt/" + os.path.basename(package))
    checks.that(came_back(machine, process), "an upgrade starts the new program", output + machine.journal())
    output = machine.run("dpkg", "-P", UNIT)
    checks.equal(machine.run("systemctl", "is-active", UNIT).strip(), "inactive", "purging stops the service")
    checks.that("warning" not in output.lower(), "purging says nothing odd", output)
    left = [path for path in ("/var/lib/tbm", "/etc/tbm", "/usr/bin/camera_box") if os.path.exists(root + path)]
    checks.equal(left, [], "purging takes the recordings along")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--source", required=True)
    parser.add_argument("--tree", required=True)
    parser.add_argument("--own-world", required=True)
    arguments = parser.parse_args()
    world.need(["mmdebstrap", "cpack", "unshare", "nsenter"])
    checks = world.Checks()
    out = tempfile.mkdtemp()
    machine = None
    try:
        package = world.pack(arguments.source, arguments.tree, f"{out}/a", "1.0.0")[UNIT]
        later = world.pack(arguments.source, arguments.tree, f"{out}/b", "1.1.0")[UNIT]
        box = world.World(arguments.source, arguments.own_world, "amd64", ("systemd", "systemd-sysv", "udev"))
        root = box.unpack()
        checks.step("root file system unpacked")
        prepare(box, root, package, f"{arguments.tree}/bin/tbm_sim", arguments.source)
        checks.step("the package is installed")
        machine = Machine(root)
        if not machine.wait_for_boot():
            machine.log.seek(0)
            checks.that(False, "systemd runs", machine.log.read() + (machine.run("systemctl") if machine.first else ""))
            checks.end()
        machine.run("systemctl", "start", "simulator")
        checks.step("systemd runs")
        check_delivered_rig(checks, machine, root)
        check_service(checks, machine)
        checks.step("looked at")
        check_bounds(checks, machine)
        check_watch(checks, machine)
        checks.step("hung, killed, stopped")
        check_package(checks, box, machine, root, later)
        checks.step("upgraded and purged")
    finally:
        if machine:
            machine.end()
        shutil.rmtree(out)
    checks.end()


if __name__ == "__main__":
    main()
