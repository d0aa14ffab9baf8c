"""A journal says what it says to the library of its own format, without a line of ours: every field of
every topic under its name, and after tbm repair at whichever byte the file was cut. The tables of
tbm export say the same.

  journal_npm_test.py JOURNAL_SAMPLES TBM

The expected values stand here a second time, under the names of the .idl files. A field of the IDL
that is not among them is a failure.
"""
import csv
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile

root = pathlib.Path(__file__).resolve().parents[3]
modules = root / "build/npm/node_modules"
samples, tbm = sys.argv[1:3]
failures = []


def expect(condition, what):
    if not condition:
        failures.append(what)


def covariance(size, scale):
    """As AnyCovariance of the samples: no two numbers alike."""
    return [scale * ((1.0 * (i + 1) if i == j else 1e-2 * (i + j)) + 1e-8 * (size * i + j))
            for i in range(size) for j in range(size)]


T = 1_700_000_000_000_000_000

EXPECTED = {
    "frame_features": {
        "machine_id": "machine-7", "sensed_at_utc_ns": T + 1, "published_at_utc_ns": T + 2,
        "frame_number": 3_000_000_000_003, "exposure_s": 0.004, "reason": "frame_saturated",
        "background_dn": 5.5, "noise_dn": 6.25, "rejected_spots": 7, "dropped_spots": 8,
        "frames_received": 9_000_000_000_009, "frames_lost": 10, "frames_damaged": 11, "frames_skipped": 12,
        "spots": [{"u_px": 100.125 + 20 * i, "v_px": 101.25 + 20 * i, "sigma_px": 0.102 + i,
                   "peak_dn": 103.0 + 20 * i, "background_dn": 104.0 + 20 * i, "spread_px": 105.5 + 20 * i,
                   "elongation": 106.5 + 20 * i, "clipped_pixels": 107 + 20 * i, "led_index": led}
                  for i, led in enumerate([8, -1, 10])],
    },
    "inclination": {
        "machine_id": "machine-8", "sensor": "camera", "sensed_at_utc_ns": T + 21, "published_at_utc_ns": T + 22,
        "sample_number": 23_000_000_000, "validity": "TILT_DEGRADED", "reason": "vibration",
        "beta_rad": 0.0241, "gamma_rad": -0.0252, "sigma_rad": 0.000263,
    },
    "relative_pose": {
        "machine_id": "machine-9", "sensed_at_utc_ns": T + 31, "published_at_utc_ns": T + 32,
        "sample_number": 33_000_000_000,
        "rig_hash": "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef",
        "status": "POSE_STATUS_DEGRADED", "reason": "POSE_REASON_LED_EXCLUDED", "reason_code": "led_excluded",
        "camera_from_target_qw": 0.5, "camera_from_target_qx": 0.1, "camera_from_target_qy": -0.7,
        "camera_from_target_qz": 0.5, "camera_from_target_translation_m": [0.341, -0.342, 3.43],
        "covariance": [(1e-3 * (i + 1) if i == j else 1e-5 * (i + j)) + 1e-11 * (6 * i + j)
                       for i in range(6) for j in range(6)],
        "leds_used": 4, "leds_used_mask": 0x80000015, "excluded_led_index": 3, "tilts_used": True,
        "chi2": 35.5, "dof": 36, "rms_px": 0.037,
        "points": [
            {"name": "shield_head", "in_camera_m": [40.1, 40.2, 40.3], "sigma_m": 0.0404, "bound_m": 0.0405},
            {"name": "shield_tail", "in_camera_m": [50.1, 50.2, 50.3], "sigma_m": 1.0404, "bound_m": math.nan},
        ],
    },
    "device_health": {
        "machine_id": "machine-10", "device_id": "inclinometer_target", "published_at_utc_ns": T + 51,
        "state": "DEVICE_SILENT", "state_since_utc_ns": T + 49, "samples_good": 52_000_000_000,
        "samples_lost": 53, "errors": 54, "reconnects": 55,
        "detail": "no answer on the serial line for 1.2 s; is the plug in?",
    },
    "event": {
        "machine_id": "machine-11", "source": "camera_box", "code": "mounting_moved", "at_utc_ns": T + 61,
        "sample_number": 62_000_000_000, "severity": "EVENT_WARNING", "active": True,
        "text": "the target's inclinometer no longer agrees with the image: 0.05 degree",
    },
    "station_observation": {
        "machine_id": "machine-12", "station": "total_station", "sensed_at_utc_ns": T + 101,
        "published_at_utc_ns": T + 102, "sample_number": 103_000_000_000, "set_up_number": 104,
        "cycle_number": 105, "kind": "OBSERVED_REFERENCE", "target": "ref_3", "face": "OBSERVATION_FACE_TWO",
        "status": "OBSERVATION_DEGRADED", "reason": "not_fully_corrected", "sensed_within_s": 0.106,
        "circle_rad": 1.07, "zenith_rad": 4.71, "slope_m": 109.25, "prism_constant_m": -0.0344, "ppm": 11.1,
        "position_in_site_m": [112.1, 113.2, 114.3], "covariance_of_reading_m2": covariance(3, 1e-6),
        "by_station": [1.25 + 0.5 * i for i in range(12)],
    },
    "station_set_up": {
        "machine_id": "machine-13", "role": "proposed", "station": "total_station", "published_at_utc_ns": T + 202,
        "set_up_number": 203, "state": "SET_UP_SUSPECT", "reason": "station_moved",
        "set_up_at_utc_ns": T + 198, "last_good_check_at_utc_ns": T + 199,
        "position_in_site_m": [204.1, 205.2, 206.3], "circle_zero_bearing_rad": 2.07,
        "covariance": covariance(4, 2e-6), "chi2": 20.8, "dof": 209, "sees_m": 0.0021,
        "closure_m": [0.0022, -0.0023, 0.0024], "closure_worst_m": 0.0025, "closure_tolerance_m": 0.0026,
        "closure_points": 27,
        "references": [{"name": ["ref_1", "ref_2"][i], "position_in_site_m": [228.1 + i, 229.2 + i, 230.3 + i],
                        "used": i == 0, "reason": ["moved", "left_out"][i], "across_m": 0.0231 + i,
                        "up_m": -0.0232 - i, "slope_m": 0.0233 + i, "standardised": 2.34 + i,
                        "checked_share": 0.235 + 0.1 * i} for i in range(2)],
    },
    "shield_pose": {
        "machine_id": "machine-14", "shield": "front", "valid_at_utc_ns": T + 301, "published_at_utc_ns": T + 302,
        "sample_number": 303_000_000_000, "validity": "GUIDANCE_DEGRADED", "reason": "station_coasting",
        "age_s": 30.4, "site_from_shield_qw": 0.5, "site_from_shield_qx": 0.1, "site_from_shield_qy": -0.7,
        "site_from_shield_qz": 0.5, "position_in_site_m": [305.1, 306.2, -307.3],
        "covariance": covariance(6, 3e-6), "speed_m_per_s": 0.0011, "speed_sigma_m_per_s": 0.00012,
        "heading_rad": -3.1, "pitch_rad": 0.0311, "roll_rad": -0.0312, "heading_sigma_rad": 0.000313,
        "pitch_sigma_rad": 0.000314, "roll_sigma_rad": 0.000315,
    },
    "guidance": {
        "machine_id": "machine-15", "valid_at_utc_ns": T + 401, "published_at_utc_ns": T + 402,
        "sample_number": 403_000_000_000, "validity": "GUIDANCE_DEGRADED", "reason": "camera_coasting",
        "axis_name": "main tunnel",
        "axis_sha256": "a123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef",
        "machine_sha256": "b123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef",
        "set_up_number": 404, "lead_right_per_m": 0.00405, "lead_up_per_m": -0.00406,
        "lead_right_sigma_per_m": 0.000407, "lead_up_sigma_per_m": 0.000408,
        "articulation_right_rad": 0.00409, "articulation_up_rad": -0.0041, "articulation_roll_rad": 0.00411,
        "articulation_right_sigma_rad": 0.000412, "articulation_up_sigma_rad": 0.000413,
        "articulation_roll_sigma_rad": 0.000414, "stroke_m": 0.415, "stroke_sigma_m": 0.00416,
        "ring_number": 417, "prisms_used": 3, "prisms_chi2": 4.18, "prisms_dof": 5, "prisms_rms_m": 0.00419,
        "prisms_remark": "left_out prism_4", "steer_by": "cutter_face",
        "sources": [
            {"name": "station", "freshness": "SOURCE_FRESH", "age_s": 42.0, "reason": "inconsistent"},
            {"name": "camera", "freshness": "SOURCE_COASTING", "age_s": 43.0, "reason": "too_few_leds"},
        ],
        "points": [{
            "name": ["cutter_face", "tail"][i], "shield": ["front", "rear"][i],
            "validity": ["GUIDANCE_DEGRADED", "GUIDANCE_VALID"][i], "reason": ["station_coasting", ""][i],
            "position_in_site_m": [430.1 + m, 431.2 + m, 432.3 + m], "position_sigma_m": 0.00433 + m,
            "chainage_m": 434.4 + m, "official_chainage_m": 435.5 + m, "official_section": 1 + i,
            "chainage_sigma_m": 0.00436 + m, "deviation_right_m": 0.0437 + m, "deviation_up_m": -0.0438 - m,
            "deviation_right_sigma_m": 0.00439 + m, "deviation_up_sigma_m": 0.0044 + m,
            "right_up_correlation": 0.1 + 0.1 * i, "trend_right_per_m": 0.00441 + m, "trend_up_per_m": 0.00442 + m,
            "trend_right_sigma_per_m": 0.000443 + m, "trend_up_sigma_per_m": 0.000444 + m,
            "trend_length_m": 4.45 + m} for i, m in enumerate([0.0, 30.0])],
        "ahead": [{"ahead_m": 1.0 + i, "deviation_right_m": 0.046 + i, "deviation_up_m": -0.047 - i,
                   "deviation_right_sigma_m": 0.0048 + i, "deviation_up_sigma_m": 0.0049 + i} for i in range(2)],
    },
    "alarm": {
        "machine_id": "machine-16", "source": "guidance", "code": "deviation_high", "published_at_utc_ns": T + 502,
        "phase": "ALARM_ACKNOWLEDGED", "urgency": "ALARM_HIGH", "since_utc_ns": T + 498,
        "raised_at_utc_ns": T + 497, "raise_number": 503, "times_raised": 504, "value": 50.5,
        "raise_above": 50.0, "clear_below": 45.0, "unit": "mm",
        "cause": "the cutter face is further from the design axis than allowed",
        "response": "steer back in small steps; tell the shift engineer", "acknowledged_by": "O. Perator",
        "shelved_until_utc_ns": T + 505, "shelved_by": "F. Oreman",
        "shelved_because": "the cover of a prism is being changed",
    },
    "command": {
        "machine_id": "machine-17", "request_id": "6f9619ff-8b86-d011-b42d-00c04fc964ff",
        "addressee": "total_station", "verb": "check_references", "argument": "ref_1 ref_2", "by": "S. Urveyor",
        "because": "blasting next door", "issued_at_utc_ns": T + 601, "expires_at_utc_ns": T + 602,
    },
    "command_reply": {
        "machine_id": "machine-18", "request_id": "7f9619ff-8b86-d011-b42d-00c04fc964ff", "source": "total_station",
        "outcome": "COMMAND_FAILED", "text": "only one reference was seen; the set-up stays suspect",
        "published_at_utc_ns": T + 702,
    },
    "trolley_state": {
        "machine_id": "machine-19", "valid_at_utc_ns": T + 801, "published_at_utc_ns": T + 802,
        "sample_number": 803_000_000_000, "run_id": "run-19", "status": "RAIL_OPEN", "reason": "",
        "position_world_m": [804.1, -805.2, 806.3], "sigma_position_m": [0.0081, 0.0082, 0.0083],
        "velocity_world_m_per_s": [0.84, -0.085, 0.0086], "sigma_velocity_m_per_s": [0.00087, 0.00088, 0.00089],
        "world_from_imu_qw": 0.5, "world_from_imu_qx": 0.1, "world_from_imu_qy": -0.7, "world_from_imu_qz": 0.5,
        "sigma_attitude_rad": [0.00081, 0.00082, 0.00083],
        "gyro_bias_rad_per_s": [1.1e-5, -1.2e-5, 1.3e-5], "sigma_gyro_bias_rad_per_s": [1.4e-6, 1.5e-6, 1.6e-6],
        "accel_bias_m_per_s2": [1.7e-3, -1.8e-3, 1.9e-3], "sigma_accel_bias_m_per_s2": [2.1e-4, 2.2e-4, 2.3e-4],
        "distance_m": 80.7, "target_age_s": 8.08, "tilt_age_s": 0.089, "rest_age_s": 81.1,
        "came_too_late": 812, "gaps": 813,
    },
    "rail_line": {
        "machine_id": "machine-20", "piece": 3, "published_at_utc_ns": T + 901, "run_id": "run-20",
        "line_sha256": "c123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef",
        "method": "smoothed", "begins_at_utc_ns": T + 902, "ends_at_utc_ns": T + 903,
        "pieces": 7, "points_in_all": 900, "points_before": 256,
        "points": [{"distance_m": 90.5 + i, "position_world_m": [906.1 + i, 907.2 + i, 908.3 + i],
                    "sigma_world_m": [0.00091 + i, 0.00092 + i, 0.00093 + i],
                    "status": ["RAIL_BRIDGED", "RAIL_GAP"][i]} for i in range(2)],
    },
    "settlement": {
        "machine_id": "machine-21", "piece": 2, "published_at_utc_ns": T + 1001,
        "base_run_id": "run-21", "later_run_id": "run-22",
        "base_sha256": "d123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef",
        "later_sha256": "e123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef",
        "level": 0.95, "highest_alert": 4, "pieces": 5, "points_in_all": 600, "points_before": 128,
        "points": [{"distance_m": 10.6 + i, "dz_m": -0.0107 + 0.01 * i, "sigma_m": 0.00108 + i,
                    "is_significant": i == 0, "alert": 3 if i == 0 else 0} for i in range(2)],
    },
    "calibration_status": {
        "machine_id": "machine-23", "subject": "imu_mounting", "source": "rail_line",
        "published_at_utc_ns": T + 1101, "state": "CALIBRATION_DUE", "reason": "overdue",
        "calibrated_at_utc_ns": 1_690_000_000_000_001_102, "age_days": 115.7, "due_after_days": 90.0,
        "file_sha256": "f123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef",
        "sigmas": [{"what": ["camera_rotation", "camera_position"][i], "sigma": 0.0111 + i,
                    "unit": ["rad", "m"][i]} for i in range(2)],
    },
}

# When a sample was sent, where it is not published_at_utc_ns that says so.
SENT_AT = {"event": "at_utc_ns", "command": "issued_at_utc_ns"}


class Idl:
    """Structs and enumerators of the .idl files, read by a grammar of its own."""

    def __init__(self, folder):
        self.fields = {}  # struct -> {field: type}
        self.numbers = {}  # enumerator -> its number
        for file in sorted(folder.glob("*.idl")):
            text = re.sub(r"//.*", "", file.read_text())
            for body in re.findall(r"enum \w+\s*{([^}]*)}", text):
                self.numbers.update({word.strip(): n for n, word in enumerate(body.split(","))})
            for name, body in re.findall(r"struct (\w+)\s*{([^}]*)}", text):
                members = [re.sub(r"@\w+", "", member).split() for member in body.split(";") if member.strip()]
                self.fields[name] = {re.sub(r"\[.*", "", words[-1]): " ".join(words[:-1]) for words in members}


def compare(where, read, expected, idl):
    if isinstance(expected, dict):
        expect(set(read) == set(expected), f"{where}: fields {sorted(set(read) ^ set(expected))}")
        for name in expected:
            compare(f"{where}.{name}", read.get(name), expected[name], idl)
    elif isinstance(expected, list):
        expect(len(read) == len(expected), f"{where}: {len(read)} of {len(expected)}")
        for i, pair in enumerate(zip(read, expected)):
            compare(f"{where}[{i}]", *pair, idl)
    elif isinstance(expected, float) and math.isnan(expected):
        expect(read == "NaN", f"{where}: {read} instead of NaN")
    elif isinstance(expected, str) and expected in idl.numbers:
        expect(read == idl.numbers[expected], f"{where}: {read} instead of {expected}")
    elif isinstance(expected, int) and isinstance(read, str):  # 64 bits: as text
        expect(read == str(expected), f"{where}: {read} instead of {expected}")
    else:
        expect(type(read) is not bool or type(expected) is bool, f"{where}: a boolean")
        expect(read == expected, f"{where}: {read} instead of {expected}")


def cover(where, struct, expected, idl):
    """Every field that the IDL declares has an expected value, and no other."""
    declared = idl.fields[struct]
    expect(set(declared) == set(expected), f"{where}: not covered {sorted(set(declared) ^ set(expected))}")
    for name, type_name in declared.items():
        inner = re.match(r"sequence<\s*(\w+)", type_name)
        if inner and inner[1] in idl.fields:
            expect(expected.get(name), f"{where}.{name}: nothing in the sequence")
            for item in expected.get(name, []):
                cover(f"{where}.{name}", inner[1], item, idl)


ENU = ["east", "north", "up"]
# Names of the numbers of an array, where it becomes several columns; None leaves a number out.
ARRAYS = {
    ("relative_pose", "camera_from_target_translation_m"): [f"camera_from_target_{a}_m" for a in "xyz"],
    ("relative_pose", "in_camera_m"): [f"{a}_in_camera_m" for a in "xyz"],
    ("station_set_up", "closure_m"): [f"closure_{a}_m" for a in ENU],
    ("station_observation", "by_station"):
        [f"by_station_{a}_per_{b}" for a in ENU for b in [*ENU, "circle_zero_m_per_rad"]],
}


def upper_triangle(name, axes, unit=""):
    return [f"{name}_{a}_{b}{unit}" if i <= j else None for i, a in enumerate(axes) for j, b in enumerate(axes)]


for t in ["station_observation", "station_set_up", "shield_pose", "guidance"]:
    ARRAYS[t, "position_in_site_m"] = [f"position_in_site_{a}_m" for a in ENU]
ARRAYS["station_observation", "covariance_of_reading_m2"] = upper_triangle("covariance_of_reading", ENU, "_m2")
ARRAYS["station_set_up", "covariance"] = upper_triangle(
    "covariance", [*(f"{a}_m" for a in ENU), "circle_zero_rad"])
ARRAYS["shield_pose", "covariance"] = upper_triangle(
    "covariance", [*(f"turn_{a}_rad" for a in ENU), *(f"{a}_m" for a in ENU)])
ARRAYS["relative_pose", "covariance"] = upper_triangle(
    "covariance", [*(f"turn_{a}_rad" for a in "xyz"), *(f"{a}_m" for a in "xyz")])
for t in ["trolley_state", "rail_line"]:
    ARRAYS[t, "position_world_m"] = [f"{a}_world_m" for a in "xyz"]
    ARRAYS[t, "sigma_position_m"] = ARRAYS[t, "sigma_world_m"] = [f"sigma_{a}_m" for a in "xyz"]
for what, unit in [("velocity", "m_per_s"), ("attitude", "rad"), ("gyro_bias", "rad_per_s"),
                   ("accel_bias", "m_per_s2")]:
    ARRAYS["trolley_state", f"{what}_{unit}"] = [f"{what}_{a}_{unit}" for a in "xyz"]
    ARRAYS["trolley_state", f"sigma_{what}_{unit}"] = [f"sigma_{what}_{a}_{unit}" for a in "xyz"]
ARRAYS["trolley_state", "velocity_world_m_per_s"] = ARRAYS["trolley_state", "velocity_m_per_s"]
# What stands before the names of the fields of an item: its own name, or its place.
BEFORE = {"spots": "spot_{place}_", "points": "{name}_", "references": "reference_{name}_",
          "sources": "source_{name}_", "ahead": "ahead_{place}_", "sigmas": "{what}_"}
BY_PLACE = {"rail_line", "settlement"}  # whose points have no names
PREFIXES = re.compile("^(TILT|POSE_STATUS|DEVICE|EVENT|OBSERVED|OBSERVATION_FACE|OBSERVATION|SET_UP|GUIDANCE|"
                      "SOURCE|ALARM|COMMAND|RAIL|CALIBRATION)_")


def cells(topic, message, idl):
    """A message as tbm export is to write it: column -> text or number."""
    row = {}
    for name, value in message.items():
        if (topic, name) == ("relative_pose", "reason"):
            continue  # its word stands in reason_code
        if name in BEFORE:
            for place, item in enumerate(value, 1):
                form = "point_{place}_" if topic in BY_PLACE else BEFORE[name]
                before = form.format(place=place, name=item.get("name"), what=item.get("what"))
                inner = {field: v for field, v in item.items() if field not in ("name", "what")}
                row.update({before + field: v for field, v in cells(topic, inner, idl).items()})
        elif isinstance(value, list):
            columns = ARRAYS[topic, name]
            expect(len(columns) == len(value), f"{topic}.{name}: {len(columns)} columns")
            row.update({column: v for column, v in zip(columns, value) if column})
        elif isinstance(value, str) and value in idl.numbers:
            row[name] = PREFIXES.sub("", value).lower()
        elif value == -1 or isinstance(value, float) and math.isnan(value):
            row[name] = ""
        else:
            row[name] = int(value) if isinstance(value, bool) else value
    return row


def test_every_column(folder, idl):
    subprocess.run([samples, "full", folder / "journal"], check=True, capture_output=True)
    subprocess.run([tbm, "export", folder / "journal", "--out", folder / "tables"], check=True, capture_output=True)
    tables = {file.stem: list(csv.DictReader(file.open())) for file in (folder / "tables").iterdir()}
    expect(set(tables) == set(EXPECTED), f"tables {sorted(tables)}")
    for number, (topic, message) in enumerate(EXPECTED.items()):
        (row,) = tables[topic]
        wanted = {"log_time_utc_ns": 1_795_442_700_000_000_007 + number, "log_sequence": 1,
                  **cells(topic, message, idl)}
        expect(set(row) == set(wanted), f"{topic}.csv: columns {sorted(set(row) ^ set(wanted))}")
        for column, value in wanted.items():
            text = row.get(column, "")
            same = text == value if isinstance(value, str) else text != "" and type(value)(text) == value
            expect(same, f"{topic}.csv, {column}: {text} instead of {value}")


def read_by_node(files):
    script = root / "tests/npm/read_journal.mjs"
    run = subprocess.run(["node", script, modules, *files], capture_output=True, text=True)
    if run.returncode != 0:
        sys.exit(f"node: {run.stderr}\nare the packages of tests/npm installed? tools/setup")
    return [json.loads(line) for line in run.stdout.splitlines()]


def test_every_field(folder, idl):
    path = subprocess.run([samples, "full", folder], check=True, capture_output=True, text=True).stdout.strip()
    repaired = folder / "repaired.mcap"
    subprocess.run([tbm, "repair", path, "--out", repaired], check=True, capture_output=True)
    for journal in read_by_node([path, repaired]):
        name = pathlib.Path(journal["file"]).name
        expect(journal["streamed"].get("done") is True, f"{name}: {journal['streamed']}")
        for way, messages in [("index", journal["indexed"]), ("front", journal["streamed"].get("messages", []))]:
            if "error" in messages:
                failures.append(f"{name}, {way}: {messages['error']}")
                continue
            topics = [message["topic"] for message in messages]
            expect(sorted(topics) == sorted([*("tbm/v1/" + t for t in EXPECTED), "local/note"]), f"{way}: {topics}")
            for number, message in enumerate(messages):
                topic = message["topic"].rpartition("/")[2]
                if topic == "note":
                    expect(message["text"] == "not of DDS" and "type" not in message, f"{way}: {message}")
                    continue
                where = f"{name}, {way}, {topic}"
                expected = EXPECTED[topic]
                compare(where, message["value"], expected, idl)
                expect(message["sequence"] == 1, f"{where}: sequence {message['sequence']}")
                expect(message["log_time"] == str(1_795_442_700_000_000_007 + number), f"{where}: log time")
                sent_at = expected[SENT_AT.get(topic, "published_at_utc_ns")]
                expect(message["publish_time"] == str(sent_at), f"{where}: publish time")
                cover(where, message["type"].rpartition("::")[2], expected, idl)


def test_repaired_at_every_cut(folder):
    lines = subprocess.run([samples, "cuts", folder], check=True, capture_output=True, text=True).stdout.split()
    *chunk_ends, size = map(int, lines)
    journals = read_by_node(sorted(folder.glob("*.mcap")))
    expect(len(journals) == size - 8 + 1, f"{len(journals)} cuts of {size} bytes")
    for journal in journals:
        cut = int(pathlib.Path(journal["file"]).stem)
        texts = [message["text"] for message in journal["streamed"].get("messages", [])]
        whole = 3 * sum(end <= cut for end in chunk_ends)
        # A chunk can be whole before its index is.
        expect(whole <= len(texts) <= min(whole + 3, 12), f"cut at {cut}: {len(texts)} messages")
        expect(texts == [f"message {n}" for n in range(len(texts))], f"cut at {cut}: {texts}")
        expect(journal["streamed"].get("done") is True, f"cut at {cut}: {journal['streamed']}")
        indexed = journal["indexed"]
        expect(isinstance(indexed, list) and [m["text"] for m in indexed] == texts, f"cut at {cut}: {indexed}")


if __name__ == "__main__":
    contract = Idl(root / "idl")
    for test, arguments in [(test_every_field, [contract]), (test_every_column, [contract]), (test_repaired_at_every_cut, [])]:
        with tempfile.TemporaryDirectory() as place:
            test(pathlib.Path(place), *arguments)
    print("\n".join(failures[:40]))
    sys.exit(1 if failures else 0)
