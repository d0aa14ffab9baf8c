#pragma once

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <string>

#include "devices/camera/camera.h"
#include "devices/camera/camera_clock.h"
#include "devices/camera/camera_life.h"
#include "devices/camera/frame_id.h"
#include "devices/camera/health_board.h"

namespace tbm {

// A GigE Vision camera through Aravis 0.8.
//
// How long WaitFrame may block beyond its timeout: 0.2 s per attempt while the address does not
// answer, 3 s when another program controls the camera (six register tries of 0.5 s).
//
// The library tells a camera goodbye in several registers, each with those 3 s, and lets nobody
// shorten that: 5 to 9 s for a camera that died. Such a connection ends in a thread of its own; the
// next opening waits for it; Close and the destructor until it has had kFarewellPatience. A process
// that ends before it takes that thread along, which has nothing left to lose.
//
// Images are lent from kBuffers buffers allocated when the stream opens. The thread that calls
// WaitFrame allocates nothing per frame. Aravis' own receive thread does, twice: a record of the
// frame (88 bytes) and one of its packets (16 bytes each), both as measured with 0.8.26.
//
// The first frame after opening is often incomplete: the socket buffer grows only once the stream
// runs. It is handed out, flagged, and not counted as incomplete.
class GigeCamera final : public Camera {
 public:
  static constexpr int kBuffers = 4;
  static constexpr Duration kFarewellPatience = std::chrono::seconds(1);

  GigeCamera(const CameraConfig& config, const Clock& clock);
  ~GigeCamera() override;
  GigeCamera(const GigeCamera&) = delete;
  GigeCamera& operator=(const GigeCamera&) = delete;

  Result<Frame, CameraFailure> WaitFrame(Duration timeout) override;
  void RequestExposure(double exposure_us) override;
  CameraHealth Health() const override { return board_.Read(); }
  void Close() override;

 private:
  struct Connection;  // everything of Aravis

  std::optional<CameraFailure> Open();
  std::optional<CameraFailure> OpenWhenDue(Duration timeout);
  std::optional<Frame> NextFrame(Duration timeout);
  std::optional<Frame> Deliver(void* buffer);
  void FillImage(void* buffer, Frame& frame) const;
  void FillTimes(void* buffer, Frame& frame);
  void CountFrame(const Frame& frame, const FrameIdCounter::Step& step, bool is_first);
  void ApplyExposure();
  CameraFailure Drop(CameraFailure why, const std::string& detail);
  void Disconnect();
  bool IsFarewellOver(Duration patience);
  void ReportSocketBuffer();

  CameraConfig config_;
  const Clock& clock_;
  CameraLife life_;
  HealthBoard board_;
  FrameIdCounter ids_;
  CameraClock camera_clock_;
  std::unique_ptr<Connection> connection_;
  std::future<void> farewell_;  // of the connection before; valid while it may not be over
  std::chrono::steady_clock::time_point farewell_began_;
  bool was_open_ = false;
  CameraFailure last_failure_ = CameraFailure::kUnreachable;

  std::atomic<double> requested_us_;  // NaN when there is nothing new
  double wanted_us_;                  // last request, clamped; survives a reconnect
  double exposure_us_;                // of the frames that arrive now
  std::optional<double> coming_us_;   // written to the camera at coming_from_
  CameraClock::SteadyTime coming_from_{};
};

}  // namespace tbm
