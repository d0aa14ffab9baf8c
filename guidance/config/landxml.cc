#include "guidance/config/landxml.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <pugixml.hpp>

#include "devices/replay/csv.h"
#include "guidance/config/landxml_plan.h"
#include "guidance/config/landxml_units.h"
#include "guidance/config/xml_element.h"

namespace tbm {
namespace {

std::string NamesOf(const std::vector<XmlElement>& elements) {
  std::string names;
  for (const XmlElement& element : elements) {
    if (names.size() > 300) return names + ", ..";
    names += (names.empty() ? "" : ", ") + Quoted(element.Attribute("name").value_or(""));
  }
  return names;
}

// The one of that name, or the only one. `option` is what the user would have to say.
std::optional<XmlElement> Chosen(const std::vector<XmlElement>& elements,
                                 const std::string& name,
                                 const XmlElement& parent,
                                 std::string_view option) {
  if (name.empty()) {
    if (elements.size() == 1) return elements.front();
    if (!elements.empty()) {
      parent.Fault(fmt::format(
          "holds {}: {}; choose one with {} NAME", elements.size(), NamesOf(elements), option));
    }
    return std::nullopt;
  }
  for (const XmlElement& element : elements) {
    if (element.Attribute("name") == name) return element;
  }
  parent.Fault(
      fmt::format("holds none with the name {}; there are {}", Quoted(name), NamesOf(elements)));
  return std::nullopt;
}

class AlignmentReader {
 public:
  AlignmentReader(const XmlElement& root, const AxisFileOptions& options, LoadedAxis* loaded)
      : root_(root),
        options_(options),
        units_(ReadUnits(root)),
        description_(loaded->description),
        warnings_(loaded->warnings) {}

  void Read(const std::string& file) {
    file_ = file;
    std::vector<XmlElement> alignments;
    for (const XmlElement& group : root_.Children("Alignments")) {
      for (const XmlElement& alignment : group.Children("Alignment")) {
        alignments.push_back(alignment);
      }
    }
    if (alignments.empty()) root_.Fault("holds no Alignments/Alignment; there is no axis in it");
    const auto alignment = Chosen(alignments, options_.alignment, root_, "--alignment");
    if (alignment) ReadAlignment(*alignment);
  }

 private:
  void ReadAlignment(const XmlElement& alignment) {
    description_.name = alignment.Attribute("name").value_or("");
    const auto start =
        alignment.RequiredNumber("staStart", "write the chainage of the first point");
    description_.start = {start.value_or(0.0) * units_.length_m};
    if (const auto length = alignment.Number("length")) {
      description_.stated_length_m = *length * units_.length_m;
    }
    if (const auto geometry = alignment.Child("CoordGeom")) {
      description_.plan = LandXmlPlanReader(root_, units_, options_.site_origin).Read(*geometry);
    } else {
      alignment.Fault("has no CoordGeom; that is where its plan stands");
    }
    ReadProfiles(alignment);
    if (const auto cant = alignment.Child("Cant")) ReadCant(*cant);
    for (const XmlElement& equation : alignment.Children("StaEquation")) ReadEquation(equation);
    std::stable_sort(
        description_.equations.begin(),
        description_.equations.end(),
        [](const StationEquation& a, const StationEquation& b) { return a.at < b.at; });
  }

  void ReadProfiles(const XmlElement& alignment) {
    std::vector<XmlElement> designs;
    for (const XmlElement& profile : alignment.Children("Profile")) {
      for (const XmlElement& design : profile.Children("ProfAlign")) designs.push_back(design);
    }
    if (designs.empty() && options_.profile.empty()) {
      warnings_.push_back({file_,
                           alignment.line(),
                           alignment.path(),
                           "has no Profile/ProfAlign: this axis has no heights"});
      return;
    }
    const auto design = Chosen(designs, options_.profile, alignment, "--profile");
    if (!design) return;
    for (const XmlElement& element : design->Children()) ReadProfileElement(element);
  }

  void ReadProfileElement(const XmlElement& element) {
    ProfileElement point;
    point.line = element.line();
    const std::string_view name = element.name();
    if (name == "Feature") return;
    if (name == "ParaCurve") {
      point.kind = ProfileKind::kParabola;
      point.length_in_m = LengthOf(element, "length");
    } else if (name == "UnsymParaCurve") {
      point.kind = ProfileKind::kUnequalParabolas;
      point.length_in_m = LengthOf(element, "lengthIn");
      point.length_out_m = LengthOf(element, "lengthOut");
    } else if (name == "CircCurve") {
      point.kind = ProfileKind::kCircle;
      const auto radius = element.RequiredNumber("radius", "write the radius of the circle");
      point.radius_m = radius.value_or(0.0) * units_.length_m;
      if (radius && *radius == 0.0)
        element.FaultAt("radius", "is 0; write the radius of the circle");
      if (element.Attribute("length")) point.length_in_m = LengthOf(element, "length");
    } else if (name != "PVI") {
      element.Fault("is not known; ProfAlign holds PVI, ParaCurve, UnsymParaCurve and CircCurve");
      return;
    }
    const auto place =
        element.Numbers(2, 2, "write the chainage and the height, with a blank between them");
    if (!place) return;
    point.at = {(*place)[0] * units_.length_m};
    point.up_m = (*place)[1] * units_.length_m - options_.site_origin.z();
    description_.profile.push_back(point);
  }

  double LengthOf(const XmlElement& element, std::string_view attribute) const {
    const auto length = element.RequiredNumber(attribute, "write the length along the plan");
    if (length && *length < 0.0) {
      element.FaultAt(attribute,
                      fmt::format("{} is below 0; write the length along the plan", *length));
      return 0.0;
    }
    return length.value_or(0.0) * units_.length_m;
  }

  void ReadCant(const XmlElement& cant) {
    const auto gauge = cant.RequiredNumber("gauge", "write the distance from rail to rail");
    description_.gauge_m = gauge.value_or(0.0) * units_.length_m;
    if (cant.Attribute("rotationPoint")) {
      constexpr CantPivot kPivots[] = {CantPivot::kInsideRail,
                                       CantPivot::kOutsideRail,
                                       CantPivot::kCentre,
                                       CantPivot::kLeftRail,
                                       CantPivot::kRightRail};
      const auto pivot = cant.RequiredWord(
          "rotationPoint", {"insideRail", "outsideRail", "center", "leftRail", "rightRail"});
      if (pivot) description_.pivot = kPivots[*pivot];
    }
    for (const XmlElement& station : cant.Children("CantStation")) {
      CantStation place;
      place.line = station.line();
      const auto at = station.RequiredNumber("station", "write the chainage");
      const auto applied =
          station.RequiredNumber("appliedCant", "write the cant in millimetres, or inches");
      const auto side = station.RequiredWord("curvature", {"cw", "ccw"});
      // In a clockwise curve the left rail is the outer one. `adverse` is cant the wrong way.
      const auto adverse = station.Attribute("adverse");
      const bool is_adverse = adverse && (*adverse == "true" || *adverse == "1");
      const double sign = (side.value_or(0) == 0) == is_adverse ? -1.0 : 1.0;
      place.at = {at.value_or(0.0) * units_.length_m};
      place.left_over_right_m = sign * applied.value_or(0.0) * units_.cant_m;
      description_.cant.push_back(place);
    }
  }

  void ReadEquation(const XmlElement& element) {
    StationEquation equation;
    equation.line = element.line();
    const auto at = element.RequiredNumber("staInternal",
                                           "write where it is, in the counting without equations");
    const auto ahead =
        element.RequiredNumber("staAhead", "write the chainage that counts from here");
    equation.at = {at.value_or(0.0) * units_.length_m};
    equation.ahead_m = ahead.value_or(0.0) * units_.length_m;
    if (const auto back = element.Number("staBack")) equation.back_m = *back * units_.length_m;
    if (element.Attribute("staIncrement")) {
      equation.is_increasing =
          element.RequiredWord("staIncrement", {"increasing", "decreasing"}).value_or(0) == 0;
    }
    description_.equations.push_back(equation);
  }

  const XmlElement& root_;
  const AxisFileOptions& options_;
  LandXmlUnits units_;
  AxisDescription& description_;
  AxisFileFaults& warnings_;
  std::string file_;
};

}  // namespace

Result<LoadedAxis, AxisFileFaults> ParseLandXml(std::string_view text,
                                                const std::string& file,
                                                const AxisFileOptions& options) {
  AxisFileFaults faults;
  const XmlSource source(text, file, &faults);
  pugi::xml_document document;
  const pugi::xml_parse_result parsed =
      document.load_buffer(text.data(), text.size(), pugi::parse_default, pugi::encoding_utf8);
  if (!parsed) {
    return Failure{AxisFileFaults{{file,
                                   source.LineOf(parsed.offset),
                                   "",
                                   fmt::format("is not XML: {}", parsed.description())}}};
  }
  const XmlElement root(document.document_element(), "", &source);
  if (root.name() != "LandXML") {
    root.Fault(fmt::format("the outermost element is {}, not LandXML", Quoted(root.name())));
    return Failure{std::move(faults)};
  }
  LoadedAxis loaded;
  AlignmentReader(root, options, &loaded).Read(file);
  if (!faults.empty()) return Failure{std::move(faults)};
  return loaded;
}

}  // namespace tbm
