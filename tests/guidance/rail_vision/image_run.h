#pragma once

#include <string>
#include <vector>

#include "tests/guidance/rail/rail_generator.h"
#include "tests/guidance/rail_vision/scene_picture.h"
#include "tests/support/temp_folder.h"

namespace tbm::test {

struct ImageTarget {
  std::string name;
  std::string kind;  // as in targets.csv
  Eigen::Vector3d in_world_m;
};

// A generated run as a folder with images in it, painted from where the trolley truly was.
class ImageRun {
 public:
  explicit ImageRun(GeneratedRun run) : run_(std::move(run)) {}

  // rail.yaml, imu.csv, tilt.csv and truth.csv.
  void WriteRun() const;
  // targets.csv with their kinds, and where each truly is.
  void WriteTargets(const std::vector<ImageTarget>& targets) const;
  // frames.csv and frames/, one image in `every_s`, of what `scenery` holds.
  void WriteFrames(const Scenery& scenery, double every_s) const;
  // ground_frames.csv and ground/, while it moves. The height is the truth's z.
  void WriteGroundFrames(const Scenery& scenery, double every_s) const;
  // centres.csv: the run's image points as they are.
  void WriteCentres() const;

  const std::string& path() const { return folder_.path(); }
  std::string operator/(std::string_view name) const { return folder_ / name; }
  const GeneratedRun& run() const { return run_; }

 private:
  void WriteImages(const Scenery& scenery,
                   const CameraModel& model,
                   const Rigid3& camera_from_imu,
                   const std::vector<RailTruth>& places,
                   const std::string& name,
                   const std::string& folder) const;

  TempFolder folder_;
  GeneratedRun run_;
};

}  // namespace tbm::test
