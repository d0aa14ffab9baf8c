"""The camera box's package in an emulated Debian 12 armhf: installs with what it depends on, the program
starts as the service's user, an upgrade keeps an edited configuration, removing keeps it too, purging
leaves nothing; its dependencies are the real ones, and few."""
import argparse
import os
import shutil
import tempfile

import package_world as world

LIMIT_MB = 90.0
CONFIG = "/etc/tbm/camera_box.yaml"
RIG = "/etc/tbm/rig.yaml"
USER = "tbm-camera-box"
BESIDE_LIBRARIES = {"systemd", "passwd", "init-system-helpers"}


def installed_kb(box, root):
    lines = box.inside(root, ["dpkg-query", "-W", "-f=${Package} ${Installed-Size}\n"]).splitlines()
    return {name: int(size) for name, size in (line.split() for line in lines)}


def read(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def with_other_defaults(package, folder):
    """The same package with other contents in both conffiles, as a later version would have."""
    world.run(["dpkg-deb", "-R", package, f"{folder}/tree"])
    for path in (CONFIG, RIG):
        with open(f"{folder}/tree{path}", "a", encoding="utf-8") as file:
            file.write("# a later default\n")
    later = f"{folder}/{os.path.basename(package)}"
    world.run(["dpkg-deb", "--root-owner-group", "-Zgzip", "-b", f"{folder}/tree", later])
    return later


def check_fresh(checks, box, root):
    checks.equal(box.inside(root, ["id", "-nG", USER]).split(), [USER, "dialout"], "user and its groups")
    entry = box.inside(root, ["getent", "passwd", USER]).strip().split(":")
    checks.that(int(entry[2]) < 1000 and entry[6] == "/usr/sbin/nologin", "a system user who cannot log in", str(entry))
    for command, wanted in ((["--version"], "."), (["--check", CONFIG], f"{CONFIG}: good")):
        said = box.inside(root, ["runuser", "-u", USER, "--", "camera_box", *command],
                          environment=["QEMU_CPU=cortex-a8"], check=False)
        checks.that(said.returncode == 0 and wanted in said.stdout,
                    f"camera_box {' '.join(command)} as {USER} on a Cortex-A8", said.stdout)
    conffiles = box.inside(root, ["dpkg-query", "-W", "-f=${Conffiles}", USER])
    in_etc = [path for path in world.run(["dpkg", f"--root={root}", "-L", USER]).split()
              if path.startswith("/etc/") and os.path.isfile(root + path)]
    for path in in_etc:
        checks.that(path in conffiles, f"{path} is a conffile")
    checks.equal(len(in_etc), 3, "files below /etc")
    link = f"{root}/etc/systemd/system/multi-user.target.wants/{USER}.service"
    checks.that(os.path.islink(link), "the service is switched on")


def check_upgrade(checks, box, root, later):
    with open(root + CONFIG, "a", encoding="utf-8") as file:
        file.write("# of this machine\n")
    edited = read(root + CONFIG)
    box.install(root, [later], ["--force-confdef", "--force-confold"])
    checks.equal(read(root + CONFIG), edited, "an upgrade keeps the edited configuration")
    checks.that("a later default" in read(root + RIG), "an upgrade brings what was not edited up to date")
    checks.that("a later default" in read(f"{root}{CONFIG}.dpkg-dist"), "the new default lies beside the edited one")
    checks.equal(box.inside(root, ["dpkg-query", "-W", "-f=${Version}", USER]), "1.1.0", "version after the upgrade")
    return edited


def check_end(checks, box, root, edited, before):
    runs = f"{root}/var/lib/tbm/runs"
    os.makedirs(f"{runs}/run_20260101_000000", exist_ok=True)
    box.inside(root, ["dpkg", "-r", USER])
    checks.equal(read(root + CONFIG), edited, "removing keeps the configuration")
    checks.that(os.path.isdir(f"{runs}/run_20260101_000000"), "removing keeps recorded runs")
    checks.that(not os.path.exists(f"{root}/usr/bin/camera_box"), "removing takes the program away")
    box.inside(root, ["dpkg", "-P", USER])
    after = world.snapshot(root)
    left = sorted(path for path in after if path not in before)
    gone = sorted(path for path in before if path not in after)
    changed = sorted(path for path in after if path in before and after[path] != before[path])
    checks.equal((left, gone, changed), ([], [], []), "purging leaves nothing: (left, gone, changed)")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--source", required=True)
    parser.add_argument("--tree", required=True)
    parser.add_argument("--own-world", required=True)
    arguments = parser.parse_args()
    world.need(["mmdebstrap", "qemu-arm-static", "dpkg-shlibdeps", "cpack", "arm-linux-gnueabihf-objdump"])
    checks = world.Checks()
    out = tempfile.mkdtemp()
    os.chmod(out, 0o755)
    try:
        package = world.pack(arguments.source, arguments.tree, f"{out}/a", "1.0.0")[USER]
        again = world.pack(arguments.source, arguments.tree, f"{out}/b", "1.0.0")[USER]
        with open(package, "rb") as one, open(again, "rb") as other:
            checks.that(one.read() == other.read(), "packing twice gives the same bytes")
        os.makedirs(f"{out}/later")
        later = with_other_defaults(world.pack(arguments.source, arguments.tree, f"{out}/c", "1.1.0")[USER],
                                    f"{out}/later")
        checks.equal(world.run(["dpkg-deb", "-f", package, "Architecture"]).strip(), "armhf", "architecture")

        box = world.World(arguments.source, arguments.own_world, "armhf")
        root = box.unpack()
        checks.step("root file system unpacked")
        minimal = installed_kb(box, root)
        count = box.install_dependencies(root, package)
        before = world.snapshot(root)
        checks.step(f"the {count} packages that it needs are installed")
        box.install(root, [package])
        checks.step("the package is installed")

        added = {name: kb for name, kb in installed_kb(box, root).items() if name not in minimal}
        total_mb = sum(added.values()) * 1024 / 1e6
        largest = sorted(added.items(), key=lambda item: -item[1])[:6]
        print(f"figure: {len(added)} packages, {total_mb:.1f} MB over a minimal system (wanted {LIMIT_MB:.0f}); "
              + ", ".join(f"{name} {kb / 1e3:.1f}" for name, kb in largest))
        checks.that(total_mb <= LIMIT_MB, f"at most {LIMIT_MB:.0f} MB over a minimal system")

        world.check_dependencies(checks, world.parse_depends(world.run(["dpkg-deb", "-f", package, "Depends"])),
                                 world.shlibdeps(root, f"{root}/usr/bin/camera_box", "armhf", arguments.own_world),
                                 BESIDE_LIBRARIES)
        check_fresh(checks, box, root)
        checks.step("looked at")
        edited = check_upgrade(checks, box, root, later)
        checks.step("upgraded")
        check_end(checks, box, root, edited, before)
    finally:
        shutil.rmtree(out)
    checks.end()


if __name__ == "__main__":
    main()
