"""The PC's packages: what they hold, and that they depend on the libraries that their programs load."""
import argparse
import os
import subprocess
import tempfile

import package_world as world

BESIDE_LIBRARIES = {"tbm-camera-box": {"systemd", "passwd", "init-system-helpers"}, "tbm-tools": set()}
HELD = {"tbm-camera-box": ["/usr/bin/camera_box"],
        "tbm-tools": ["/usr/bin/guidance", "/usr/bin/rail_line", "/usr/bin/total_station", "/usr/bin/hmi_bridge", "/usr/bin/tbm", "/usr/bin/tbm_sim", "/usr/bin/camera_sim", "/usr/bin/total_station_sim",
                      "/usr/share/bash-completion/completions/tbm", "/usr/share/zsh/vendor-completions/_tbm"]}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--source", required=True)
    parser.add_argument("--tree", required=True)
    arguments = parser.parse_args()
    checks = world.Checks()
    with tempfile.TemporaryDirectory() as work:
        packages = world.pack(arguments.source, arguments.tree, f"{work}/out")
        checks.equal(set(packages), set(HELD), "packages for a PC")
        os.makedirs(f"{work}/debian")
        with open(f"{work}/debian/control", "w", encoding="utf-8") as control:
            control.write("Source: any\n")
        for name, package in packages.items():
            unpacked = f"{work}/{name}"
            world.run(["dpkg-deb", "-x", package, unpacked])
            for path in HELD[name]:
                checks.that(os.path.getsize(unpacked + path) > 0, f"{name} holds {path}")
            programs = [f"{unpacked}{path}" for path in HELD[name] if path.startswith("/usr/bin/")]
            for program in programs:
                sections = world.run(["objdump", "-h", program])
                checks.that(".debug_info" not in sections and ".symtab" not in world.run(["readelf", "-SW", program]),
                            f"{os.path.basename(program)} is stripped")
            line = subprocess.run(["dpkg-shlibdeps", "-O", *programs], cwd=work, stdout=subprocess.PIPE,
                                  stderr=subprocess.DEVNULL, text=True, check=True).stdout
            world.check_dependencies(checks, world.parse_depends(world.run(["dpkg-deb", "-f", package, "Depends"])),
                                     world.parse_depends(line.strip().removeprefix("shlibs:Depends=")),
                                     BESIDE_LIBRARIES[name])
    checks.end()


if __name__ == "__main__":
    main()
