"""Fails when a source file includes a layer that its folder may not know.

The compiler cannot do this: the distribution puts every library under /usr/include, so an include of
Fast DDS inside pose/ would compile unnoticed.

  include_rules.py ROOT              check the tree
  include_rules.py ROOT --self-test  check that planted violations are found
"""
import pathlib
import re
import sys
import tempfile

POSIX = {"signal.h", "fcntl.h", "poll.h", "termios.h", "unistd.h", "sys", "pty.h", "arpa", "netinet", "net", "ifaddrs.h"}
VECTOR_UNIT = {"emmintrin.h", "arm_neon.h"}
POSE = {"pose/base", "pose/geometry", "pose/rig/rig.h"}
POSE_ALL = {"pose/base", "pose/geometry", "pose/rig", "pose/centres", "pose/solve", "pose/frame"}

# folder -> what its files may include besides the C++ standard library and their own folder
ALLOWED = {
    "pose/base": set(),
    "pose/geometry": {"Eigen", "pose/base"},
    "pose/centres": {"Eigen", *POSE, "pose/solve", *VECTOR_UNIT},
    "pose/solve": {"Eigen", *POSE, "ceres"},
    "pose/calibrate": {"Eigen", "opencv2", *POSE, "pose/centres/image_view.h", "pose/solve"},
    "pose/rig": {"Eigen", "pose/base", "pose/geometry", "yaml-cpp", "fmt", "arpa/inet.h"},
    "pose/frame": {"Eigen", *POSE, "pose/centres", "pose/solve"},
    "pose/app": {"Eigen", *POSE_ALL, "devices", "idl/cpp", "fmt", "CLI", "yaml-cpp", "openssl", "systemd", *POSIX},
    "devices/bus": {"pose/base", *POSIX},
    "devices/camera": {"Eigen", *POSE, "pose/centres", "devices/bus", "devices/sim", "devices/replay", "arv.h", "fmt", *POSIX},
    "devices/gsi": {"pose/base", "devices/replay/csv.h", "fmt"},
    "devices/total_station": {"Eigen", "pose/base", "devices/bus", "devices/sim/hash_noise.h", "boost/asio", "fmt", *POSIX},
    "devices/imu": {"Eigen", "pose/base", "devices/bus", "fmt"},
    "devices/inclinometer": {"pose/base", "pose/geometry", "devices/bus", "devices/sim", "modbus", "fmt", *POSIX},
    "devices/replay": {"Eigen", *POSE_ALL, "png.h", "tiffio.h", "fmt", *POSIX},
    "devices/sim": {"Eigen", *POSE, "pose/centres/image_view.h"},
    "devices/app": {"Eigen", *POSE_ALL, "devices", "guidance/axis", "guidance/config", "guidance/core/machine.h",
                    "guidance/core/alarm_board.h", "guidance/core/alarm_command.h", "guidance/station", "idl/cpp",
                    "pose/app/service_manager.h", "fmt", "CLI", "yaml-cpp", *POSIX, "arv.h"},
    "guidance/app": {"Eigen", *POSE_ALL, "pose/calibrate", "devices", "guidance/axis", "guidance/fusion", "guidance/rail", "guidance/rail_study", "guidance/rail_vision", "guidance/config", "guidance/core",
                     "guidance/journal", "idl/cpp", "fmt", "CLI", "nlohmann", *POSIX},
    "guidance/station": {"Eigen", "pose/base", "pose/geometry", "pose/solve/tails.h"},
    "guidance/shield": {"Eigen", *POSE, "pose/solve",
                        "guidance/axis"},
    "guidance/axis": {"Eigen", "pose/base", "pose/geometry"},
    "guidance/fusion": {"Eigen", "pose/base", "pose/geometry", "pose/solve/tails.h"},
    "guidance/rail": {"Eigen", "pose/base", "pose/geometry", "guidance/fusion"},
    "guidance/rail_vision": {"Eigen", "opencv2", "guidance/fusion", "guidance/rail", "pose/base", "pose/geometry", "pose/centres", "pose/calibrate"},
    "guidance/rail_study": {"Eigen", "pose/base", "pose/geometry", "guidance/fusion", "guidance/rail"},
    "guidance/core": {"Eigen", *POSE, "guidance/axis", "guidance/station", "guidance/shield"},
    "guidance/journal": {"pose/base", "zlib.h"},
    "guidance/config": {"Eigen", "pose/base", "pose/rig", "guidance/axis", "guidance/fusion", "guidance/rail", "guidance/core/machine.h", "devices/replay/csv.h",
                        "devices/imu/stim_config.h", "devices/inclinometer/inclinometer_config.h", "pose/app/inclinometer_section.h", "yaml-cpp", "fmt", "pugixml.hpp", "openssl"},
    "hmi_bridge/core": {"Eigen", *POSE, "guidance/axis", "guidance/core", "guidance/shield", "idl/cpp/messages.h", "idl/cpp/guidance_messages.h", "idl/cpp/rail_messages.h",
                        "idl/cpp/alarm.h", "idl/cpp/bounded_text.h", "idl/cpp/words.h", "hmi_bridge/server/console_source.h", "nlohmann", "fmt"},
    "hmi_bridge/server": {"pose/base", "boost", "openssl", "nlohmann", "fmt", "zlib.h", *POSIX},
    "hmi_bridge/app": {"Eigen", *POSE_ALL, "devices/app/end_signals.h", "devices/app/service_run.h", "guidance/axis", "guidance/config", "guidance/core",
                       "guidance/app/exit_code.h", "idl/cpp", "hmi_bridge", "nlohmann", "fmt", "CLI", "yaml-cpp", *POSIX},
    "idl/cpp": {"Eigen", *POSE_ALL, "fastdds", "fastrtps", "fastcdr", "tbm_idl", "fmt", *POSIX},
}
# Folders that compute and do nothing else, and the standard headers that would betray them.
PURE = {"pose/base", "pose/geometry", "pose/centres", "pose/solve", "pose/frame", "pose/calibrate", "guidance/axis", "guidance/station", "guidance/shield", "guidance/fusion", "guidance/rail", "guidance/core",
        "guidance/journal", "hmi_bridge/core"}
EFFECTS = {"condition_variable", "filesystem", "fstream", "future", "iostream", "mutex", "thread", "ctime", "random"}
# One file alone may know a library that its folder may not.
ONLY_IN = {"opencv2": {"pose/calibrate", "guidance/rail_vision"},
           "ceres": {"pose/solve/penalty_pose.cc"},
           "systemd": {"pose/app/service_manager.cc"},
           "emmintrin.h": {"pose/centres/vectors_sse2.h"},
           "arm_neon.h": {"pose/centres/vectors_neon.h"},
           "arv.h": {"devices/camera", "devices/app"},
           "boost": {"devices/total_station/asio_link.cc", "hmi_bridge/server"},
           "pugixml.hpp": {"guidance/config"},
           "yaml-cpp": {"pose/rig", "pose/app", "guidance/config", "devices/app", "hmi_bridge/app"}}

INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)


def under(name, folder):
    return name == folder or name.startswith(folder + "/")


def violations(root):
    for file in sorted(p for p in root.rglob("*") if p.suffix in {".h", ".cc"}):
        path = file.relative_to(root).as_posix()
        top = path.split("/")[0]
        if top not in {"pose", "guidance", "devices", "idl", "hmi_bridge"}:
            continue
        owners = [folder for folder in ALLOWED if under(path, folder)]
        if not owners:
            yield f"{path}: its folder has no include rule; add one to {pathlib.Path(__file__).name}"
            continue
        owner = max(owners, key=len)
        for name in INCLUDE.findall(file.read_text()):
            allowed = ALLOWED[owner] | {owner}
            is_standard = "/" not in name and "." not in name
            if is_standard:
                is_fine = owner not in PURE or name not in EFFECTS
            else:
                is_fine = any(under(name, folder) for folder in allowed)
            for library, places in ONLY_IN.items():
                if under(name, library) and not any(under(path, place) for place in places):
                    is_fine = False
            if not is_fine:
                yield f"{path}: {owner} must not know <{name}>"


def self_test():
    planted = {
        "pose/solve/a.cc": "#include <fastdds/dds/core/policy/QosPolicies.hpp>\n",
        "pose/solve/b.cc": "#include <ceres/ceres.h>\n",
        "pose/frame/c.cc": "#include <thread>\n",
        "devices/camera/d.h": '#include "devices/inclinometer/inclinometer.h"\n',
        "pose/nowhere/e.h": "#pragma once\n",
        "idl/cpp/f.cc": "#include <yaml-cpp/yaml.h>\n",
        "guidance/app/h.cc": "#include <opencv2/core.hpp>\n",
        "pose/app/g.cc": '#include "tbm_idl/event.h"\n',
    }
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for name, text in planted.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text)
        found = list(violations(root))
        missed = [name for name in planted if not any(line.startswith(name + ":") for line in found)]
        (root / "pose/solve/penalty_pose.cc").write_text("#include <ceres/ceres.h>\n")
        if any("penalty_pose" in line for line in violations(root)):
            missed.append("penalty_pose.cc refused although it may know ceres")
        return [f"not found: {name}" for name in missed]


if __name__ == "__main__":
    problems = self_test() if "--self-test" in sys.argv else list(violations(pathlib.Path(sys.argv[1])))
    print("\n".join(problems))
    sys.exit(1 if problems else 0)
