#include "guidance/config/landxml_units.h"

#include <cmath>
#include <numbers>
#include <string>

#include "pose/base/angle.h"
#include "pose/base/parse_number.h"

namespace tbm {
namespace {

// International foot since 1959; the US survey foot is 1200 / 3937 m.
constexpr double kFoot_m = 0.3048;
constexpr double kUsSurveyFoot_m = 1200.0 / 3937.0;

AngleForm FormOf(const XmlElement& system, std::string_view attribute) {
  // The schema's default, when the attribute is missing.
  if (!system.Attribute(attribute)) return AngleForm::kRadians;
  constexpr AngleForm kForms[] = {AngleForm::kRadians,
                                  AngleForm::kGrads,
                                  AngleForm::kDecimalDegrees,
                                  AngleForm::kDegreesMinutesSeconds};
  const auto form =
      system.RequiredWord(attribute, {"radians", "grads", "decimal degrees", "decimal dd.mm.ss"});
  return form ? kForms[*form] : AngleForm::kRadians;
}

std::optional<double> FromDegreesMinutesSeconds(std::string_view text) {
  const bool is_negative = text.starts_with('-');
  if (is_negative || text.starts_with('+')) text.remove_prefix(1);
  const std::size_t point = std::min(text.find('.'), text.size());
  const std::string_view whole = text.substr(0, point);
  std::string digits(point < text.size() ? text.substr(point + 1) : "");
  if (digits.find_first_not_of("0123456789") != std::string::npos) return std::nullopt;
  while (digits.size() < 4) digits += '0';
  const auto degrees = ParseInteger(whole);
  const auto minutes = ParseInteger(std::string_view(digits).substr(0, 2));
  const auto seconds = ParseReal(digits.substr(2, 2) + "." + digits.substr(4) + "0");
  if (!degrees || *degrees < 0 || !minutes || !seconds) return std::nullopt;
  if (*minutes > 60 || *seconds > 60.0) return std::nullopt;
  const double angle_deg =
      static_cast<double>(*degrees) + static_cast<double>(*minutes) / 60.0 + *seconds / 3600.0;
  return DegToRad(is_negative ? -angle_deg : angle_deg);
}

}  // namespace

std::optional<double> AngleFromText(std::string_view text, AngleForm form) {
  const auto words = WordsOf(text);
  if (words.size() != 1) return std::nullopt;
  if (form == AngleForm::kDegreesMinutesSeconds) return FromDegreesMinutesSeconds(words[0]);
  const auto number = ParseReal(words[0]);
  if (!number || !std::isfinite(*number)) return std::nullopt;
  switch (form) {
    case AngleForm::kGrads:
      return *number * std::numbers::pi / 200.0;
    case AngleForm::kDecimalDegrees:
      return DegToRad(*number);
    default:
      return number;
  }
}

LandXmlUnits ReadUnits(const XmlElement& root) {
  LandXmlUnits units;
  const auto element = root.Child("Units");
  if (!element) {
    root.Fault(
        "has no element Units: a number could be metres or feet; add "
        "<Units><Metric linearUnit=\"meter\" .. /></Units>");
    return units;
  }
  if (const auto metric = element->Child("Metric")) {
    constexpr double kLengths_m[] = {1.0, 0.001, 0.01, 0.1, 1000.0};
    const auto unit = metric->RequiredWord(
        "linearUnit", {"meter", "millimeter", "centimeter", "decimeter", "kilometer"});
    if (unit) units.length_m = kLengths_m[*unit];
    units.angle = FormOf(*metric, "angularUnit");
    units.direction = FormOf(*metric, "directionUnit");
    return units;
  }
  const auto imperial = element->Child("Imperial");
  if (!imperial) {
    element->Fault("holds neither Metric nor Imperial; one of them says what a number means");
    return units;
  }
  constexpr double kLengths_m[] = {kFoot_m, kUsSurveyFoot_m, kFoot_m / 12.0, 5280.0 * kFoot_m};
  const auto unit = imperial->RequiredWord("linearUnit", {"foot", "USSurveyFoot", "inch", "mile"});
  if (unit) units.length_m = kLengths_m[*unit];
  units.cant_m = kFoot_m / 12.0;
  units.angle = FormOf(*imperial, "angularUnit");
  units.direction = FormOf(*imperial, "directionUnit");
  return units;
}

}  // namespace tbm
