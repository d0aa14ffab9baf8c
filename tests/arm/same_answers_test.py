"""The recorded runs through the PC's and the camera box's `tbm solve` give the same poses.

Limits: 1e-6 mm (the last digit that poses.csv has) and 1e-9 degree. Status, reason and LEDs have to be equal.
"""

import argparse
import csv
import math
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile

LIMIT_MM = 1e-6
LIMIT_DEG = 1e-9
EQUAL = ("stamp_ns", "status", "reason", "leds_used")
ROTATION = ("qw", "qx", "qy", "qz")
# Sums over pixels and centres, printed with six digits after the point; not a pose.
LOOSE = {"rms_px": 2e-6, "sigma_rot_x_deg": 2e-8, "sigma_rot_y_deg": 2e-8, "sigma_rot_z_deg": 2e-8}
SKIPPED = 77


def solve(command, run, out):
    result = subprocess.run(
        [*command, "solve", str(run), "--out", str(out)], capture_output=True, text=True, check=False
    )
    if not out.exists():
        sys.exit(f"{' '.join(command)} solve {run}: exit code {result.returncode}\n{result.stderr}")
    with open(out, newline="", encoding="ascii") as file:
        return list(csv.DictReader(file))


def angle_deg(a, b):
    """Between two unit quaternions; stays exact near zero, where 1 - cos does not."""
    p = [float(a[key]) for key in ROTATION]
    q = [float(b[key]) for key in ROTATION]
    sign = math.copysign(1.0, sum(x * y for x, y in zip(p, q)))
    half_chord = 0.5 * math.sqrt(sum((x - sign * y) ** 2 for x, y in zip(p, q)))
    return math.degrees(4.0 * math.asin(min(half_chord, 1.0)))


def compare(name, pc, box):
    """Faults as text, and the largest differences seen."""
    faults = []
    worst_mm = worst_deg = 0.0
    if len(pc) != len(box):
        return [f"{name}: {len(pc)} and {len(box)} rows"], 0.0, 0.0, 0
    poses = 0
    for row, (a, b) in enumerate(zip(pc, box), start=2):
        for key in EQUAL:
            if a[key] != b[key]:
                faults.append(f"{name}:{row}: {key} is '{a[key]}' and '{b[key]}'")
        if not a["qw"] or not b["qw"]:
            if a["qw"] != b["qw"]:
                faults.append(f"{name}:{row}: a pose on one machine only")
            continue
        poses += 1
        deg = angle_deg(a, b)
        worst_deg = max(worst_deg, deg)
        if not deg <= LIMIT_DEG:
            faults.append(f"{name}:{row}: rotations differ by {deg:.3g} degree")
        for key in a:
            if key in EQUAL or key in ROTATION:
                continue
            if (a[key] == "") != (b[key] == ""):
                faults.append(f"{name}:{row}: {key} is '{a[key]}' and '{b[key]}'")
            elif a[key]:
                difference = abs(float(a[key]) - float(b[key]))
                if key.endswith("_mm"):
                    worst_mm = max(worst_mm, difference)
                if not difference <= LOOSE.get(key, LIMIT_MM) * 1.000001:
                    faults.append(f"{name}:{row}: {key} differs by {difference:.3g}")
    return faults, worst_mm, worst_deg, poses


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--pc", required=True)
    parser.add_argument("--box", required=True)
    parser.add_argument("--emulator", required=True)
    parser.add_argument("--source", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    if not os.path.exists(arguments.box):
        print(f"{arguments.box} is not there: tools/arm/build makes it")
        return SKIPPED

    shared = pathlib.Path(os.environ.get("TBM_SHARED", arguments.source / ".." / "shared"))
    runs = [arguments.source / "tests" / "data" / "run_small"]
    for name in ("run_bench", "run_drive", "run_hostile", "run_faults"):
        run = shared / "data" / name
        if run.is_dir():
            runs.append(run)
        else:
            print(f"{run} is not there and is left out")

    all_faults = []
    with tempfile.TemporaryDirectory() as folder:
        for run in runs:
            pc = solve([arguments.pc], run, pathlib.Path(folder) / f"{run.name}_pc.csv")
            box = solve(
                [*shlex.split(arguments.emulator), arguments.box],
                run,
                pathlib.Path(folder) / f"{run.name}_box.csv",
            )
            faults, worst_mm, worst_deg, poses = compare(run.name, pc, box)
            print(f"{run.name}: {poses} poses of {len(pc)} frames, at most {worst_mm:.1e} mm and {worst_deg:.1e} degree apart")
            if poses == 0:
                faults.append(f"{run.name}: no pose to compare")
            all_faults += faults
    print("\n".join(all_faults))
    return 1 if all_faults else 0


if __name__ == "__main__":
    sys.exit(main())
