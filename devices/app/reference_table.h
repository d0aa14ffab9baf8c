#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "pose/base/result.h"

namespace tbm {

struct ReferenceRow {
  std::string name;
  Eigen::Vector3d p_in_site = Eigen::Vector3d::Zero();
  double sigma_m = 0.0;
  double constant_m = 0.0;  // of its prism
  bool is_control = false;
};

// A CSV: name,x_m,y_m,z_m,sigma_mm in `site`; optional prism_constant_mm and control (0 or 1). The
// error names file, line and column, and what would be right.
Result<std::vector<ReferenceRow>, std::string> ReadReferenceTable(const std::string& path);

}  // namespace tbm
