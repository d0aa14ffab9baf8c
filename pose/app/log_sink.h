#pragma once

#include "idl/cpp/dds_process.h"
#include "pose/app/box_messages.h"

namespace tbm {

// Passes everything on, and writes one log line to standard error for each event.
class LogSink final : public MessageSink {
 public:
  explicit LogSink(MessageSink& sink) : sink_(sink) {}  // which outlives it

  void Publish(const dds::FrameFeatures& message) override { sink_.Publish(message); }
  void Publish(const dds::TiltReading& message) override { sink_.Publish(message); }
  void Publish(const dds::RelativePose& message) override { sink_.Publish(message); }
  void Publish(const dds::DeviceHealth& message) override { sink_.Publish(message); }
  void Publish(const dds::Event& event) override {
    dds::LogEvent(event);
    sink_.Publish(event);
  }

 private:
  MessageSink& sink_;
};

}  // namespace tbm
