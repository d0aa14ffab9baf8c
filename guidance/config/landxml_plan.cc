#include "guidance/config/landxml_plan.h"

#include <array>
#include <cmath>

#include <fmt/format.h>

#include "devices/replay/csv.h"

namespace tbm {
namespace {

constexpr std::string_view kPointRule = "write north and east, with a blank between them";

struct SpiralWord {
  std::string_view word;
  SpiralLaw law;
};
constexpr std::array<SpiralWord, 12> kSpirals = {{
    {"clothoid", SpiralLaw::kClothoid},
    {"bloss", SpiralLaw::kBloss},
    {"cosine", SpiralLaw::kCosine},
    {"sinusoid", SpiralLaw::kSinusoid},
    {"biquadratic", SpiralLaw::kBiquadratic},
    {"weinerBogen", SpiralLaw::kWienerBogen},
    {"wienerBogen", SpiralLaw::kWienerBogen},
    {"cubic", SpiralLaw::kCubicSpiral},
    {"cubicParabola", SpiralLaw::kCubicParabola},
    {"japaneseCubic", SpiralLaw::kJapaneseCubic},
    {"sineHalfWave", SpiralLaw::kSineHalfWave},
    {"biquadraticParabola", SpiralLaw::kBiquadraticParabola},
}};

// Types that the schema names and nobody has published a formula for.
std::string WhyNot(std::string_view type) {
  if (type == "radioid") {
    return "names a family: over the arc it is a clothoid, over the chord a lemniscate, over the "
           "abscissa an elastica; the schema does not say which. Export it as clothoid if it is "
           "one";
  }
  if (type.starts_with("rev")) {
    return "stands in the schema without a formula, and none is published; export the curve as two "
           "spirals of a plain type";
  }
  return "is not known; write clothoid, bloss, cosine, sinusoid, biquadratic, cubic, "
         "cubicParabola, "
         "japaneseCubic, sineHalfWave, biquadraticParabola or weinerBogen";
}

SpiralLaw ReadLaw(const XmlElement& element) {
  const auto type = element.Attribute("spiType");
  if (!type) {
    element.FaultAt("spiType", "is missing; clothoid is the most common type");
    return SpiralLaw::kClothoid;
  }
  for (const SpiralWord& spiral : kSpirals) {
    if (spiral.word == *type) return spiral.law;
  }
  element.FaultAt("spiType", fmt::format("{} {}", Quoted(*type), WhyNot(*type)));
  return SpiralLaw::kClothoid;
}

Turning ReadTurning(const XmlElement& element) {
  return element.RequiredWord("rot", {"cw", "ccw"}).value_or(0) == 0 ? Turning::kRight
                                                                     : Turning::kLeft;
}

}  // namespace

LandXmlPlanReader::LandXmlPlanReader(const XmlElement& root,
                                     const LandXmlUnits& units,
                                     const Eigen::Vector3d& site_origin)
    : units_(units), site_origin_(site_origin) {
  for (const XmlElement& group : root.Children("CgPoints")) {
    for (const XmlElement& point : group.Children("CgPoint")) {
      if (const auto name = point.Attribute("name")) points_.emplace(*name, point);
    }
  }
}

std::vector<PlanElement> LandXmlPlanReader::Read(const XmlElement& coord_geom) {
  std::vector<PlanElement> plan;
  for (const XmlElement& element : coord_geom.Children()) ReadElement(element, &plan);
  if (plan.empty()) coord_geom.Fault("holds no Line, Curve or Spiral; an axis needs one");
  return plan;
}

void LandXmlPlanReader::ReadElement(const XmlElement& element, std::vector<PlanElement>* plan) {
  const std::string_view name = element.name();
  if (name == "Line") {
    plan->push_back(ReadLine(element));
  } else if (name == "Curve") {
    plan->push_back(ReadCurve(element));
  } else if (name == "Spiral") {
    plan->push_back(ReadSpiral(element));
  } else if (name == "IrregularLine") {
    ReadPolyline(element, plan);
  } else if (name == "Chain") {
    ReadChain(element, plan);
  } else if (name != "Feature") {
    element.Fault(
        "is not known here; CoordGeom holds Line, Curve, Spiral, IrregularLine and Chain");
  }
}

Eigen::Vector2d LandXmlPlanReader::InSite(double north, double east) const {
  return {east * units_.length_m - site_origin_.x(), north * units_.length_m - site_origin_.y()};
}

// Coordinates, or the name of a CgPoint; where both stand, coordinates win.
std::optional<Eigen::Vector2d> LandXmlPlanReader::PointOf(const XmlElement& point) const {
  if (WordsOf(point.Text()).empty()) {
    if (const auto reference = point.Attribute("pntRef")) {
      const auto found = points_.find(*reference);
      if (found == points_.end()) {
        point.FaultAt("pntRef", fmt::format("no CgPoint has the name {}", Quoted(*reference)));
        return std::nullopt;
      }
      const auto numbers = found->second.Numbers(2, 3, kPointRule);
      if (!numbers) return std::nullopt;
      return InSite((*numbers)[0], (*numbers)[1]);
    }
  }
  const auto numbers = point.Numbers(2, 3, kPointRule);
  if (!numbers) return std::nullopt;
  return InSite((*numbers)[0], (*numbers)[1]);
}

std::optional<Eigen::Vector2d> LandXmlPlanReader::PointChild(const XmlElement& parent,
                                                             std::string_view name) const {
  const auto point = parent.Child(name);
  if (!point) return std::nullopt;
  return PointOf(*point);
}

Eigen::Vector2d LandXmlPlanReader::RequiredPoint(const XmlElement& parent,
                                                 std::string_view name) const {
  if (!parent.Child(name)) {
    parent.Fault(fmt::format("has no {}; {}", name, kPointRule));
    return Eigen::Vector2d::Zero();
  }
  return PointChild(parent, name).value_or(Eigen::Vector2d::Zero());
}

std::optional<double> LandXmlPlanReader::Length(const XmlElement& element,
                                                std::string_view attribute) const {
  const auto number = element.Number(attribute);
  if (!number) return std::nullopt;
  return *number * units_.length_m;
}

std::optional<double> LandXmlPlanReader::Angle(const XmlElement& element,
                                               std::string_view attribute,
                                               AngleForm form) const {
  const auto text = element.Attribute(attribute);
  if (!text) return std::nullopt;
  const auto angle = AngleFromText(*text, form);
  if (!angle) {
    element.FaultAt(attribute,
                    fmt::format("{} is no angle{}",
                                Quoted(*text),
                                form == AngleForm::kDegreesMinutesSeconds
                                    ? "; the file's unit is dd.mm.ss: 45 30'25\" is 45.3025"
                                    : "; write digits with '.' as decimal mark"));
  }
  return angle;
}

StatedValues LandXmlPlanReader::Stated(const XmlElement& element) const {
  StatedValues stated;
  stated.length_m = Length(element, "length");
  stated.start_chainage_m = Length(element, "staStart");
  stated.chord_m = Length(element, "chord");
  stated.turn_rad = Angle(element, "delta", units_.angle);
  if (!stated.turn_rad) stated.turn_rad = Angle(element, "theta", units_.angle);
  stated.bearing_start_rad = Angle(element, "dir", units_.direction);
  if (!stated.bearing_start_rad) {
    stated.bearing_start_rad = Angle(element, "dirStart", units_.direction);
  }
  stated.bearing_end_rad = Angle(element, "dirEnd", units_.direction);
  stated.clothoid_constant_m = Length(element, "constant");
  stated.total_x_m = Length(element, "totalX");
  stated.total_y_m = Length(element, "totalY");
  stated.tangent_m = Length(element, "tangent");
  stated.tangent_long_m = Length(element, "tanLong");
  stated.tangent_short_m = Length(element, "tanShort");
  stated.intersection = PointChild(element, "PI");
  return stated;
}

PlanElement LandXmlPlanReader::ReadLine(const XmlElement& element) const {
  LineElement line{RequiredPoint(element, "Start"), RequiredPoint(element, "End")};
  return {line, Stated(element), element.line()};
}

PlanElement LandXmlPlanReader::ReadCurve(const XmlElement& element) const {
  CurveElement curve;
  curve.start = RequiredPoint(element, "Start");
  curve.end = RequiredPoint(element, "End");
  curve.centre = PointChild(element, "Center");
  curve.radius_m = Length(element, "radius");
  curve.turning = ReadTurning(element);
  if (!element.Child("Center") && !element.Attribute("radius")) {
    element.Fault("has neither Center nor radius; one of them makes the curve");
  }
  return {curve, Stated(element), element.line()};
}

PlanElement LandXmlPlanReader::ReadSpiral(const XmlElement& element) const {
  SpiralElement spiral;
  spiral.start = RequiredPoint(element, "Start");
  spiral.end = RequiredPoint(element, "End");
  spiral.law = ReadLaw(element);
  const auto length =
      element.RequiredNumber("length", "write the length along the curve, more than 0");
  if (length && !(*length > 0.0)) {
    element.FaultAt("length", fmt::format("{} is not more than 0", *length));
  }
  spiral.length_m = length.value_or(0.0) * units_.length_m;
  // Some writers have no INF and state a radius beyond all tunnels: the same to a micrometre.
  constexpr double kStraight_m = 1e12;
  const auto curvature = [&](std::string_view attribute) {
    const auto radius = element.RequiredRadius(attribute);
    const double radius_m = radius.value_or(kStraight_m) * units_.length_m;
    return std::abs(radius_m) < kStraight_m ? 1.0 / radius_m : 0.0;
  };
  spiral.curvature_start_per_m = curvature("radiusStart");
  spiral.curvature_end_per_m = curvature("radiusEnd");
  spiral.turning = ReadTurning(element);
  return {spiral, Stated(element), element.line()};
}

void LandXmlPlanReader::ReadPolyline(const XmlElement& element,
                                     std::vector<PlanElement>* plan) const {
  const auto flat = element.Child("PntList2D");
  const auto list = flat ? flat : element.Child("PntList3D");
  if (!list) {
    element.Fault("has neither PntList2D nor PntList3D; the points of the line go there");
    return;
  }
  const std::size_t width = flat ? 2 : 3;
  constexpr std::size_t kMostNumbers = 3'000'000;
  const auto numbers = list->Numbers(2 * width, kMostNumbers, kPointRule);
  if (!numbers) return;
  if (numbers->size() % width != 0) {
    list->Fault(fmt::format("holds {} numbers, which {} does not divide", numbers->size(), width));
    return;
  }
  std::vector<Eigen::Vector2d> points;
  for (std::size_t i = 0; i < numbers->size(); i += width) {
    points.push_back(InSite((*numbers)[i], (*numbers)[i + 1]));
  }
  AddLines(element, points, plan);
}

void LandXmlPlanReader::ReadChain(const XmlElement& element, std::vector<PlanElement>* plan) const {
  std::vector<Eigen::Vector2d> points;
  for (const std::string_view name : WordsOf(element.Text())) {
    const auto found = points_.find(name);
    if (found == points_.end()) {
      element.Fault(fmt::format("no CgPoint has the name {}", Quoted(name)));
      return;
    }
    const auto numbers = found->second.Numbers(2, 3, kPointRule);
    if (!numbers) return;
    points.push_back(InSite((*numbers)[0], (*numbers)[1]));
  }
  if (points.size() < 2) {
    element.Fault("names fewer than two points");
    return;
  }
  AddLines(element, points, plan);
}

void LandXmlPlanReader::AddLines(const XmlElement& element,
                                 const std::vector<Eigen::Vector2d>& points,
                                 std::vector<PlanElement>* plan) {
  for (std::size_t i = 1; i < points.size(); ++i) {
    plan->push_back({LineElement{points[i - 1], points[i]}, {}, element.line()});
  }
}

}  // namespace tbm
