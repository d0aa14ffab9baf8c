#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "guidance/axis/axis_description.h"
#include "guidance/config/landxml_units.h"
#include "guidance/config/xml_element.h"

namespace tbm {

// Reads CoordGeom: the plan of an alignment. Northing-first becomes east-first here and nowhere
// else; units become metres and radians here.
class LandXmlPlanReader {
 public:
  LandXmlPlanReader(const XmlElement& root,
                    const LandXmlUnits& units,
                    const Eigen::Vector3d& site_origin);

  std::vector<PlanElement> Read(const XmlElement& coord_geom);

 private:
  void ReadElement(const XmlElement& element, std::vector<PlanElement>* plan);
  std::optional<Eigen::Vector2d> PointChild(const XmlElement& parent, std::string_view name) const;
  Eigen::Vector2d RequiredPoint(const XmlElement& parent, std::string_view name) const;
  std::optional<Eigen::Vector2d> PointOf(const XmlElement& point) const;
  Eigen::Vector2d InSite(double north, double east) const;
  std::optional<double> Length(const XmlElement& element, std::string_view attribute) const;
  std::optional<double> Angle(const XmlElement& element,
                              std::string_view attribute,
                              AngleForm form) const;
  StatedValues Stated(const XmlElement& element) const;
  PlanElement ReadLine(const XmlElement& element) const;
  PlanElement ReadCurve(const XmlElement& element) const;
  PlanElement ReadSpiral(const XmlElement& element) const;
  void ReadPolyline(const XmlElement& element, std::vector<PlanElement>* plan) const;
  void ReadChain(const XmlElement& element, std::vector<PlanElement>* plan) const;
  static void AddLines(const XmlElement& element,
                       const std::vector<Eigen::Vector2d>& points,
                       std::vector<PlanElement>* plan);

  LandXmlUnits units_;
  Eigen::Vector3d site_origin_;
  std::map<std::string, XmlElement, std::less<>> points_;  // CgPoint by name
};

}  // namespace tbm
