#pragma once

#include <chrono>
#include <optional>

#include "devices/camera/camera.h"

namespace tbm {

// When to open, when to call a camera silent, when to give the connection up: the decisions of a
// network camera as a function of instants, so that each can be tested without waiting.
//
//   closed --(back-off over)--> opening --ok--> streaming --(no frame)--> silent --(lost)--> closed
//                                  \--failed--> closed        ^--(frame)----/
class CameraLife {
 public:
  using Instant = std::chrono::steady_clock::time_point;

  // The library says a connection is lost only after its heartbeat has failed for five seconds. A
  // camera that answers but sends nothing for kGiveUpAfter has forgotten us and is opened anew.
  static constexpr Duration kGiveUpAfter = std::chrono::milliseconds(1500);
  static constexpr Duration kAskAgainAfter = std::chrono::milliseconds(500);
  static constexpr Duration kFirstBackOff = std::chrono::milliseconds(250);
  static constexpr Duration kLongestBackOff = std::chrono::seconds(2);
  // A camera may take this long from "start" to its first frame.
  static constexpr Duration kFirstFrameGrace = std::chrono::seconds(1);

  explicit CameraLife(Duration silent_after) : silent_after_(silent_after) {}

  CameraState state() const { return state_; }

  // closed: how long until opening may be tried; zero means now.
  Duration UntilOpening(Instant now) const;
  void Opening();
  void OpeningFailed(Instant now);
  void Opened(Instant now);

  void GotFrame(Instant now);
  void GotNothing(Instant now);  // may turn streaming into silent

  // silent: true when it is time to ask whether the camera answers at all.
  bool ShouldAsk(Instant now) const;
  void Asked(Instant now) { next_question_ = now + kAskAgainAfter; }

  // The connection has to be closed, whatever the reason.
  void Lost(Instant now);

 private:
  Duration silent_after_;
  CameraState state_ = CameraState::kClosed;
  std::optional<Instant> next_opening_;
  Duration back_off_ = kFirstBackOff;
  Instant silent_from_{};  // when a missing frame means silence
  Instant next_question_{};
};

}  // namespace tbm
