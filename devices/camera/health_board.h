#pragma once

#include <mutex>
#include <string>

#include "devices/camera/camera.h"

namespace tbm {

// A camera's health, written by its grabber thread and read by any.
class HealthBoard {
 public:
  CameraHealth Read() const {
    const std::lock_guard lock(mutex_);
    return health_;
  }

  template <class Change>
  void Update(Change change) {
    const std::lock_guard lock(mutex_);
    change(health_);
  }

  void Fail(CameraState state, CameraFailure failure, const std::string& detail) {
    Update([&](CameraHealth& health) {
      health.state = state;
      health.failure = failure;
      health.detail = detail;
    });
  }

 private:
  mutable std::mutex mutex_;
  CameraHealth health_;
};

}  // namespace tbm
