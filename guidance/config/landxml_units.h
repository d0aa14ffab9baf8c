#pragma once

#include <optional>
#include <string_view>

#include "guidance/config/xml_element.h"

namespace tbm {

enum class AngleForm {
  kRadians,
  kGrads,
  kDecimalDegrees,
  kDegreesMinutesSeconds,  // "45.3025" is 45 degrees 30 minutes 25 seconds
};

// What one unit of the file is worth.
struct LandXmlUnits {
  double length_m = 1.0;
  double cant_m = 0.001;  // millimetres, or inches in an Imperial file
  AngleForm angle = AngleForm::kRadians;
  AngleForm direction = AngleForm::kRadians;
};

// Reads the element Units; its faults go to the document's list.
LandXmlUnits ReadUnits(const XmlElement& root);

// Empty when the text is no angle of that form.
std::optional<double> AngleFromText(std::string_view text, AngleForm form);

}  // namespace tbm
