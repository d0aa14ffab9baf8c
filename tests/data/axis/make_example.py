"""Makes example.xml, example_table.csv and example_shots.csv, the project's own alignment.

  make_example.py        writes the three files beside this script

Places come from Gauss-Legendre sums of the natural equation in steps of 0.5 m, heights from the
elementary formulas; nothing here is shared with the code that reads the files.
"""
import math
import pathlib

START_CHAINAGE = 10000.0
START = (4512.400, 12087.650)  # east, north
START_BEARING = math.radians(35.0)

# (kind, length, curvature to the right at the start and at the end)
ELEMENTS = [
    ("Line", 120.0, 0.0, 0.0),
    ("clothoid", 60.0, 0.0, 1 / 350.0),
    ("Curve", 180.0, 1 / 350.0, 1 / 350.0),
    ("clothoid", 60.0, 1 / 350.0, 0.0),
    ("Line", 50.0, 0.0, 0.0),
    ("bloss", 70.0, 0.0, -1 / 500.0),
    ("Curve", 100.0, -1 / 500.0, -1 / 500.0),
    ("bloss", 70.0, -1 / 500.0, 0.0),
    ("Line", 90.0, 0.0, 0.0),
]
# chainage and height where the gradients meet
GRADIENTS = [(10000.0, 412.000), (10250.0, 407.000), (10600.0, 409.800), (10800.0, 407.400)]
PARABOLA_LENGTH = 120.0
CIRCLE_RADIUS = 8000.0

NODES = [0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363]
WEIGHTS = [0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763]


def turn(kind, length, first, last, s):
    """Change of the bearing after s metres of an element."""
    u = s / length
    share = {"bloss": u**3 - u**4 / 2}.get(kind, u * u / 2)
    return first * s + (last - first) * length * share


def walk(element, place, bearing, to):
    """Place after `to` metres of an element that begins at a place with a bearing."""
    pieces = max(1, math.ceil(to / 0.5))
    east, north = place
    half = to / pieces / 2
    for piece in range(pieces):
        for node, weight in zip(NODES, WEIGHTS):
            for sign in (-1, 1):
                angle = bearing + turn(*element, (2 * piece + 1 + sign * node) * half)
                east += weight * half * math.sin(angle)
                north += weight * half * math.cos(angle)
    return east, north


def parts():
    """Each element with its first chainage, place and bearing."""
    chainage, place, bearing = START_CHAINAGE, START, START_BEARING
    for element in ELEMENTS:
        yield element, chainage, place, bearing
        place = walk(element, place, bearing, element[1])
        bearing += turn(*element, element[1])
        chainage += element[1]
    yield None, chainage, place, bearing


def place_at(chainage):
    for element, first, place, bearing in parts():
        if element is not None and chainage <= first + element[1]:
            s = chainage - first
            return walk(element, place, bearing, s), bearing + turn(*element, s)
    raise ValueError(chainage)


def height_at(chainage):
    slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in zip(GRADIENTS, GRADIENTS[1:])]
    (_, _), (v1, z1), (v2, z2), (_, _) = GRADIENTS
    d = chainage - (v1 - PARABOLA_LENGTH / 2)
    if abs(chainage - v1) < PARABOLA_LENGTH / 2:
        begin = z1 - slopes[0] * PARABOLA_LENGTH / 2
        return begin + slopes[0] * d + (slopes[1] - slopes[0]) / (2 * PARABOLA_LENGTH) * d * d
    a, b = math.atan(slopes[1]), math.atan(slopes[2])
    tangent = CIRCLE_RADIUS * math.tan(abs(b - a) / 2)
    first = v2 - tangent * math.cos(a)
    if first < chainage < v2 + tangent * math.cos(b):
        centre = first + CIRCLE_RADIUS * math.sin(a)  # a crest: the centre lies below
        top = z2 - slopes[1] * (v2 - first) - CIRCLE_RADIUS * math.cos(a)
        return top + math.sqrt(CIRCLE_RADIUS**2 - (chainage - centre) ** 2)
    for (x, z), slope, (end, _) in zip(GRADIENTS, slopes, GRADIENTS[1:]):
        if chainage <= end:
            return z + slope * (chainage - x)
    raise ValueError(chainage)


def point(name, place):
    return f"<{name}>{place[1]:.7f} {place[0]:.7f}</{name}>"


def degrees(bearing):
    return f"{math.degrees(bearing) % 360.0:.9f}"


def intersection(place, bearing, end, end_bearing):
    s = math.sin(end_bearing - bearing)
    east, north = end[0] - place[0], end[1] - place[1]
    t = (east * math.cos(end_bearing) - north * math.sin(end_bearing)) / -s
    return place[0] + t * math.sin(bearing), place[1] + t * math.cos(bearing)


def element_xml(part, following):
    (kind, length, first, last), chainage, place, bearing = part
    _, _, end, end_bearing = following
    head = f'length="{length:.4f}" staStart="{chainage:.4f}"'
    rot = "cw" if first + last > 0 else "ccw"
    if kind == "Line":
        return (f'        <Line {head} dir="{degrees(bearing)}">'
                f'{point("Start", place)}{point("End", end)}</Line>')
    if kind == "Curve":
        radius = 1 / abs(first)
        side = 1 if first > 0 else -1
        centre = (place[0] + side * radius * math.cos(bearing), place[1] - side * radius * math.sin(bearing))
        delta = math.degrees(length / radius)
        return (f'        <Curve rot="{rot}" crvType="arc" radius="{radius:.4f}" {head} delta="{delta:.9f}"'
                f' dirStart="{degrees(bearing)}" dirEnd="{degrees(end_bearing)}">\n          '
                f'{point("Start", place)}{point("Center", centre)}{point("End", end)}</Curve>')
    radii = ["INF" if k == 0 else f"{1 / abs(k):.4f}" for k in (first, last)]
    theta = math.degrees(abs(end_bearing - bearing))
    meet = intersection(place, bearing, end, end_bearing)
    return (f'        <Spiral spiType="{kind}" rot="{rot}" radiusStart="{radii[0]}" radiusEnd="{radii[1]}" {head}'
            f' theta="{theta:.9f}" dirStart="{degrees(bearing)}" dirEnd="{degrees(end_bearing)}">\n          '
            f'{point("Start", place)}{point("PI", meet)}{point("End", end)}</Spiral>')


def landxml():
    every = list(parts())
    geometry = "\n".join(element_xml(a, b) for a, b in zip(every, every[1:]))
    total = sum(element[1] for element in ELEMENTS)
    v = GRADIENTS
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<LandXML xmlns="http://www.landxml.org/schema/LandXML-1.2" version="1.2" date="2026-01-15" time="12:00:00">
  <Units>
    <Metric linearUnit="meter" areaUnit="squareMeter" volumeUnit="cubicMeter" temperatureUnit="celsius"
            pressureUnit="milliBars" angularUnit="decimal degrees" directionUnit="decimal degrees"/>
  </Units>
  <Alignments>
    <Alignment name="north tube" length="{total:.4f}" staStart="{START_CHAINAGE:.4f}">
      <StaEquation staInternal="10300.0000" staBack="10300.0000" staAhead="10350.0000" desc="short chain"/>
      <StaEquation staInternal="10650.0000" staBack="10700.0000" staAhead="10680.0000" desc="long chain"/>
      <CoordGeom>
{geometry}
      </CoordGeom>
      <Cant name="track" gauge="1.5000" rotationPoint="insideRail">
        <CantStation station="10120.0" appliedCant="0" curvature="cw"/>
        <CantStation station="10180.0" appliedCant="110" curvature="cw"/>
        <CantStation station="10360.0" appliedCant="110" curvature="cw"/>
        <CantStation station="10420.0" appliedCant="0" curvature="cw"/>
        <CantStation station="10470.0" appliedCant="0" curvature="ccw"/>
        <CantStation station="10540.0" appliedCant="80" curvature="ccw"/>
        <CantStation station="10640.0" appliedCant="80" curvature="ccw"/>
        <CantStation station="10710.0" appliedCant="0" curvature="ccw"/>
      </Cant>
      <Profile name="gradient line">
        <ProfAlign name="gradient line">
          <PVI>{v[0][0]:.4f} {v[0][1]:.4f}</PVI>
          <ParaCurve length="{PARABOLA_LENGTH:.4f}">{v[1][0]:.4f} {v[1][1]:.4f}</ParaCurve>
          <CircCurve length="{circle_length():.4f}" radius="{CIRCLE_RADIUS:.4f}">{v[2][0]:.4f} {v[2][1]:.4f}</CircCurve>
          <PVI>{v[3][0]:.4f} {v[3][1]:.4f}</PVI>
        </ProfAlign>
      </Profile>
    </Alignment>
  </Alignments>
</LandXML>
"""


def circle_length():
    slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in zip(GRADIENTS, GRADIENTS[1:])]
    return CIRCLE_RADIUS * abs(math.atan(slopes[2]) - math.atan(slopes[1]))


def table():
    lines = ["chainage_m,east_m,north_m,up_m"]
    for metre in range(0, 301):
        chainage = START_CHAINAGE + metre
        (east, north), _ = place_at(chainage)
        lines.append(f"{chainage:.4f},{east:.7f},{north:.7f},{height_at(chainage):.7f}")
    return "\n".join(lines) + "\n"


def shots():
    """Points with known deviations: name, where, how far to the right and up."""
    lines = ["point,east_m,north_m,up_m,true_chainage_m,true_right_m,true_up_m"]
    for number in range(16):
        chainage = 10012.5 + 51.25 * number
        right, up = 0.0425 * ((number * 5) % 7 - 3), 0.031 * ((number * 3) % 5 - 2)
        (east, north), bearing = place_at(chainage)
        east, north = east + right * math.cos(bearing), north - right * math.sin(bearing)
        lines.append(f"ring{number + 1},{east:.6f},{north:.6f},{height_at(chainage) + up:.6f},"
                     f"{chainage:.4f},{right:.4f},{up:.4f}")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    folder = pathlib.Path(__file__).parent
    (folder / "example.xml").write_text(landxml())
    (folder / "example_table.csv").write_text(table())
    (folder / "example_shots.csv").write_text(shots())
