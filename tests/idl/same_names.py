"""Fails when convert_guidance.cc or convert_rail.cc ties a field to another one's name, or leaves a field of the IDL out.

A field that goes to the wrong place and comes back from there is seen by no test that sends it there and
back.
"""
import pathlib
import re
import sys

ELSEWHERE = {("ShieldPose", name) for name in
             ("site_from_shield_qw", "site_from_shield_qx", "site_from_shield_qy", "site_from_shield_qz")}
ELSEWHERE |= {("TrolleyState", f"world_from_imu_q{axis}") for axis in "wxyz"}


def faults(code, idl_texts):
    wanted = set()
    for text in idl_texts:
        for struct, body in re.findall(r"struct (\w+) {(.*?)\n};", text, re.DOTALL):
            for line in body.splitlines():
                field = re.match(r"\s*(?:@key )?[\w<>, ]+? (\w+)(?:\[\d+\])?;", line.split("//")[0])
                if field:
                    wanted.add((struct, field.group(1)))
    wanted -= ELSEWHERE
    found = set()
    for struct, body in re.findall(r"Only<(\w+), M> = 0>\nvoid Fields\(.*?\) {\n(.*?)\n}", code, re.DOTALL):
        for house, wire in re.findall(r"way\(m\.([\w.]+), w\.(\w+)\(\)\);", body):
            name = house.replace("site_from_shield.translation", "position_in_site_m")
            if wire not in (name, name + "_utc_ns"):
                yield f"{struct}: {house} goes to {wire}"
            if (struct, wire) in found:
                yield f"{struct}: {wire} stands twice"
            found.add((struct, wire))
    for struct, field in sorted(wanted - found):
        yield f"{struct}: {field} is left out"
    for struct, field in sorted(found - wanted):
        yield f"{struct}: {field} is not in the IDL"


root = pathlib.Path(sys.argv[1])
code = "".join((root / f"idl/cpp/convert_{of}.cc").read_text() for of in ("guidance", "rail"))
texts = [(root / f"idl/{name}.idl").read_text()
         for name in ("station_observation", "station_set_up", "guidance", "alarm", "command",
                      "rail_line", "settlement", "calibration_status")]
for spoilt, why in ((code.replace("w.slope_m()", "w.across_m()"), "swapped"),
                    (code.replace("  way(m.axis_name, w.axis_name());\n", ""), "left out")):
    assert any(True for _ in faults(spoilt, texts)), f"a field that is {why} is not noticed"
found = list(faults(code, texts))
print("\n".join(found) or "every field has its own name on both sides")
sys.exit(1 if found else 0)
