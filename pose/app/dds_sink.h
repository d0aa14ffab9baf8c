#pragma once

#include "idl/cpp/participant.h"
#include "idl/cpp/publisher.h"
#include "pose/app/box_messages.h"

namespace tbm {

// The box's five topics on DDS. The participant outlives the sink.
class DdsSink final : public MessageSink {
 public:
  explicit DdsSink(dds::Participant& participant)
      : features_(participant),
        tilts_(participant),
        poses_(participant),
        health_(participant),
        events_(participant) {}

  void Publish(const dds::FrameFeatures& message) override { features_.Write(message); }
  void Publish(const dds::TiltReading& message) override { tilts_.Write(message); }
  void Publish(const dds::RelativePose& message) override { poses_.Write(message); }
  void Publish(const dds::DeviceHealth& message) override { health_.Write(message); }
  void Publish(const dds::Event& message) override { events_.Write(message); }

 private:
  dds::Publisher<dds::FrameFeatures> features_;
  dds::Publisher<dds::TiltReading> tilts_;
  dds::Publisher<dds::RelativePose> poses_;
  dds::Publisher<dds::DeviceHealth> health_;
  dds::Publisher<dds::Event> events_;
};

}  // namespace tbm
