"""What the package puts on the box, without installing it: the unit's exposure, the configuration as delivered, and
that the README for the person on the ladder knows every word the box can say."""
import argparse
import re
import shutil
import subprocess
import tempfile

import package_world as world

EXPOSURE_LIMIT = 2.0
# Sources whose codes go into the log, and the function that holds them.
SPOKEN = {
    "pose/base/pose_reason.cc": "ReasonCode",
    "devices/camera/camera_config.cc": "FailureCode",
    "devices/inclinometer/inclinometer_life.cc": "FailureCode",
    "idl/cpp/alarm.h": "AlarmCode",
    "idl/cpp/messages.h": "StateCode",
}
# Never seen by anybody: nothing is wrong, or a recording is over.
UNSPOKEN = {"", "not_due", "ended", "unknown"}


def read(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def check_unit(checks, package):
    unit = f"{package}/box/tbm-camera-box.service"
    said = subprocess.run(["systemd-analyze", "security", "--offline=true", "--no-pager", unit],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False).stdout
    exposure = re.search(r"Overall exposure level for .*: ([0-9.]+)", said)
    checks.that(exposure and float(exposure.group(1)) <= EXPOSURE_LIMIT,
                f"exposure {exposure.group(1) if exposure else '?'} (wanted {EXPOSURE_LIMIT})", said)
    with tempfile.TemporaryDirectory() as folder:
        # The program is not on this computer: any other stands for it.
        with open(f"{folder}/tbm-camera-box.service", "w", encoding="utf-8") as file:
            file.write(read(unit).replace("/usr/bin/camera_box", shutil.which("true")))
        said = subprocess.run(["systemd-analyze", "verify", "--man=no", f"{folder}/tbm-camera-box.service"],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False).stdout
    checks.that("tbm-camera-box" not in said, "systemd has nothing to say against the unit", said)


def check_configuration(checks, package, camera_box):
    config = read(f"{package}/box/camera_box.yaml")
    said = subprocess.run([camera_box, "--check", f"{package}/box/camera_box.yaml"], stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, check=False)
    checks.that(said.returncode == 0, "the configuration as delivered is good", said.stdout)
    checks.equal(re.findall(r"^  interfaces: (\S+)", config, re.M), ["[127.0.0.1]"], "nothing leaves the box as delivered")
    checks.equal(re.findall(r"^  address: (\S+)", config, re.M), ["127.0.0.1"], "no camera is taken as delivered")
    rules = read(f"{package}/box/serial.rules")
    ports = re.findall(r"port: /dev/(\S+)", config)
    checks.equal(ports, re.findall(r'SYMLINK\+="(\S+)"', rules), "the ports' names are those of the udev rules")
    wanted = int(re.search(r"socket_buffer_bytes: (\d+)", config).group(1))
    granted = int(re.search(r"net.core.rmem_max = (\d+)", read(f"{package}/box/sysctl.conf")).group(1))
    checks.that(granted >= wanted, f"the kernel grants the socket buffer: {granted} >= {wanted}")
    for key in set(re.findall(r"`((?:camera|dds|recording)\.[a-z_]+)`", read(f"{package}/README.box.md"))):
        section, name = key.split(".")
        in_section = re.search(rf"^{section}:\n((?:^ .*\n|^\n)*)", config, re.M)
        checks.that(in_section and re.search(rf"^  (# )?{name}: ", in_section.group(1), re.M),
                    f"README's {key} is in the configuration")


def check_words(checks, source, package):
    readme = read(f"{package}/README.box.md")
    words = {"no_pose", "mounting_moved", "clock_set", "events_dropped", "device_state", "socket_buffer_short"}
    for path, function in SPOKEN.items():
        text = read(f"{source}/{path}")
        body = text[text.index(function + "("):]
        found = set(re.findall(r'return "([a-z_]*)";', body[:body.index("\n}")]))
        checks.that(len(found) > 3, f"{path} has codes")
        words |= found
    for path in ("camera_box.cc", "health_watch.cc"):
        raised = re.findall(r'Raise\(\s*"?[a-z_]+"?,\s*"([a-z_]+)"', read(f"{source}/pose/app/{path}"))
        checks.that(raised, f"{path} raises events")
        words |= set(raised)
    missing = sorted(word for word in words - UNSPOKEN if not re.search(rf"`[^`\n]*\b{word}\b[^`\n]*`", readme))
    checks.equal(missing, [], f"README knows all {len(words - UNSPOKEN)} words that the box says; missing")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--source", required=True)
    parser.add_argument("--camera-box", required=True)
    arguments = parser.parse_args()
    if shutil.which("systemd-analyze") is None:
        world.skip("needs systemd-analyze: tools/setup arm")
    checks = world.Checks()
    package = f"{arguments.source}/tools/package"
    check_unit(checks, package)
    check_configuration(checks, package, arguments.camera_box)
    check_words(checks, arguments.source, package)
    installed = set(re.findall(r"(?:DESTINATION|RENAME) (/etc/\S+|70-\S+)", read(f"{package}/package.cmake")))
    checks.equal(installed, {"/etc/tbm", "/etc/udev/rules.d", "70-tbm-camera-box.rules"}, "what goes to /etc")
    checks.end()


if __name__ == "__main__":
    main()
