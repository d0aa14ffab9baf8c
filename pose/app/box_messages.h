#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "devices/camera/camera.h"
#include "devices/inclinometer/inclinometer.h"
#include "idl/cpp/messages.h"
#include "pose/app/recorder.h"
#include "pose/frame/frame_solver.h"

namespace tbm {

// Where the box's messages go: DDS in the process, a list in tests. Called from several threads,
// one type always from the same one; must not block.
class MessageSink {
 public:
  virtual ~MessageSink() = default;
  virtual void Publish(const dds::FrameFeatures& message) = 0;
  virtual void Publish(const dds::TiltReading& message) = 0;
  virtual void Publish(const dds::RelativePose& message) = 0;
  virtual void Publish(const dds::DeviceHealth& message) = 0;
  virtual void Publish(const dds::Event& message) = 0;
};

// Counts for frame_features, since the process began.
struct FrameCounts {
  std::uint64_t received = 0;
  std::uint64_t lost = 0;
  std::uint64_t damaged = 0;
  std::uint64_t skipped = 0;
};

// What the box concluded, in the words of the topics. published_at is left to the sink's caller.
dds::FrameFeatures FeaturesOf(std::string_view machine_id,
                              const FrameResult& result,
                              std::uint64_t frame_number,
                              double exposure_us,
                              const FrameCounts& counts);
void FillRelativePose(std::string_view machine_id,
                      std::string_view rig_hash,
                      const Rig& rig,
                      const FrameResult& result,
                      dds::RelativePose* message);

dds::DeviceHealth HealthOf(const CameraHealth& health);
dds::DeviceHealth HealthOf(const InclinometerHealth& health);
dds::DeviceHealth HealthOf(const Recorder::Status& status);

}  // namespace tbm
