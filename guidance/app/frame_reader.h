#pragma once

#include <set>
#include <vector>

#include "devices/replay/image_file.h"
#include "guidance/app/console.h"
#include "guidance/app/rail_run.h"
#include "guidance/rail_vision/rail_frames.h"

namespace tbm {

// Reads the images of a run one at a time, and complains of those that cannot be read. What is
// given to it outlives it; it stays where it is while its frames are used.
class FrameReader {
 public:
  FrameReader(const std::vector<RailFrameFile>& files,
              const CameraModel& camera,
              const Console& console);
  FrameReader(const FrameReader&) = delete;
  FrameReader& operator=(const FrameReader&) = delete;

  RailFrames Frames();

 private:
  ImageView Load(std::size_t frame);

  const std::vector<RailFrameFile>& files_;
  const ImageSize size_;
  const Console& console_;
  OwnedImage image_;
  std::set<std::size_t> told_;
};

}  // namespace tbm
