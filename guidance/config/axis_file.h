#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "guidance/axis/axis_description.h"
#include "guidance/axis/axis_remark.h"
#include "pose/base/result.h"

namespace tbm {

// One thing that is wrong in the file of an axis, or that looks like a slip of the pen.
struct AxisFileFault {
  std::string file;
  int line = 0;       // 1 is the first; 0 when the file as a whole is meant
  std::string place;  // "Alignment 'main tunnel'/CoordGeom/Spiral 2/@radiusEnd", "column east_m"
  std::string what;   // what is wrong, and what would be right

  // "axis.xml:31: Spiral 2/@radiusEnd: 'infinite' is no number; write 300 or INF"
  std::string Text() const;
};
using AxisFileFaults = std::vector<AxisFileFault>;

struct AxisFileOptions {
  std::string alignment;  // of a LandXML file that has several
  std::string profile;    // of an alignment that has several
  // Subtracted from every coordinate: frame `site` is the project's datum minus this.
  Eigen::Vector3d site_origin = Eigen::Vector3d::Zero();
};

struct LoadedAxis {
  AxisDescription description;
  AxisFileFaults warnings;  // what nobody reads, and what is read otherwise than some would expect
};

// LandXML (1.0 to 1.2) or the tunneller's table, told apart by the first character. All faults of
// the form are collected; whether the geometry makes sense is for DesignAxis::Build and Inspect.
//
// The table is a CSV with the columns east_m, north_m and, both optional, up_m and chainage_m: one
// row per point, in driving order.
Result<LoadedAxis, AxisFileFaults> ParseAxis(std::string_view bytes,
                                             const std::string& file,
                                             const AxisFileOptions& options);

// The same from a file of at most 256 MB; description.file_sha256 is what `sha256sum` prints.
Result<LoadedAxis, AxisFileFaults> LoadAxisFile(const std::string& path,
                                                const AxisFileOptions& options);

// "axis.xml:31: chainage 1240.000 m: gap of 12.3 mm: .." Without the file's name when it is empty.
std::string RemarkText(const AxisRemark& remark, const std::string& file);

// "gap", "turning_mirrored": for lists that programs read.
std::string_view RemarkCode(AxisRemarkCode code);

}  // namespace tbm
