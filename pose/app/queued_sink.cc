#include "pose/app/queued_sink.h"

namespace tbm {

QueuedSink::QueuedSink(MessageSink& sink) : sink_(sink), thread_([this] { Run(); }) {}

QueuedSink::~QueuedSink() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  news_.notify_one();
  thread_.join();
}

void QueuedSink::Publish(const dds::FrameFeatures& message) {
  {
    const std::lock_guard lock(mutex_);
    if (!features_.Push(message)) ++dropped_;
  }
  news_.notify_one();
}

void QueuedSink::Publish(const dds::RelativePose& message) {
  {
    const std::lock_guard lock(mutex_);
    if (!poses_.Push(message)) ++dropped_;
  }
  news_.notify_one();
}

std::uint64_t QueuedSink::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

void QueuedSink::Run() {
  dds::RelativePose pose;
  dds::FrameFeatures features;
  for (;;) {
    bool has_pose = false;
    bool has_features = false;
    {
      std::unique_lock lock(mutex_);
      news_.wait(lock, [this] { return is_ending_ || poses_.count > 0 || features_.count > 0; });
      has_pose = poses_.Pop(&pose);
      has_features = features_.Pop(&features);
      if (!has_pose && !has_features) return;
    }
    if (has_pose) sink_.Publish(pose);  // the pose first: somebody steers by it
    if (has_features) sink_.Publish(features);
  }
}

}  // namespace tbm
