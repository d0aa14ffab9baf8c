#include "guidance/app/frame_reader.h"

#include <fmt/format.h>

namespace tbm {
namespace {

constexpr std::size_t kMostTold = 20;

}  // namespace

FrameReader::FrameReader(const std::vector<RailFrameFile>& files,
                         const CameraModel& camera,
                         const Console& console)
    : files_(files), size_{camera.image_width_px, camera.image_height_px}, console_(console) {}

RailFrames FrameReader::Frames() {
  RailFrames frames;
  for (const RailFrameFile& file : files_) frames.stamped_at.push_back(file.stamped_at);
  frames.load = [this](std::size_t frame) { return Load(frame); };
  return frames;
}

ImageView FrameReader::Load(std::size_t frame) {
  auto image = ReadImageFile(files_[frame].path, size_);
  if (image) {
    image_ = std::move(image).value();
    return image_.View();
  }
  if (told_.insert(frame).second && told_.size() <= kMostTold) {
    Complain(console_, fmt::format("warning: {}: {}", files_[frame].path, image.error().what));
  }
  return {};
}

}  // namespace tbm
