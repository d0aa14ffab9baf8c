#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pose/base/clock.h"
#include "pose/base/result.h"
#include "pose/base/time.h"
#include "pose/centres/image_view.h"

namespace tbm {

namespace sim {
class World;
}

// Where a camera is in its life: closed -> opening -> streaming -> silent -> closed. From silent it
// goes back to streaming when frames come again before the connection is given up.
enum class CameraState { kClosed, kOpening, kStreaming, kSilent };

enum class CameraFailure {
  kNoFrameInTime,  // nothing within the time the caller was ready to wait; ask again
  kUnreachable,    // the address does not answer: cable, power, wrong address
  kInUse,          // another program controls the camera
  kRefused,        // the camera answers but rejects a setting; see CameraHealth::detail
  kSilent,         // connected, but no frame for longer than silent_after_ms
  kLost,           // the connection broke; it is being opened again
  kEndOfRun,       // replay: no frame is left
  kBadRun,         // replay: the recorded run cannot be read; see CameraHealth::detail
};

// What is wrong with the pixels of one frame.
enum class FrameFault {
  kNone,
  kMissingPackets,  // parts of the image never came; no pixels
  kFileMissing,     // replay: no such file; no pixels
  kFileUnreadable,  // replay: cut or damaged; no pixels
  kFileSize,        // replay: not the size that the run's rig is for; no pixels
};

// One exposure. It borrows its pixels: they stay valid until the next call of WaitFrame or Close on
// the same camera, and belong to the thread that made that call.
struct Frame {
  ImageView image;                 // pixels == nullptr unless complete()
  Timestamp sensed_at;             // middle of the exposure
  Timestamp received_at;           // first packet at this computer; equals sensed_at in a replay
  std::uint64_t frame_number = 0;  // counts up by one per exposure; a gap is a lost frame
  double exposure_us = 0.0;        // NaN when nobody knows
  FrameFault fault = FrameFault::kNone;

  bool complete() const { return fault == FrameFault::kNone; }
};

// Counters run from the construction of the camera object.
struct CameraHealth {
  CameraState state = CameraState::kClosed;
  std::optional<CameraFailure> failure;  // why it is not streaming; absent while it is
  std::string detail;                    // in words, for a log line; what the library said
  std::uint64_t frames = 0;              // handed out, incomplete ones included
  std::uint64_t lost = 0;                // gaps in the frame numbers while connected
  std::uint64_t incomplete = 0;  // with missing packets; the first after opening not counted
  std::uint64_t reconnects = 0;  // openings after the first that succeeded
  std::uint64_t resent_packets = 0;
  double exposure_us = 0.0;              // in force now
  int packet_size_bytes = 0;             // of the stream, agreed on when opening; 0: no network
  std::int64_t socket_buffer_bytes = 0;  // granted by the system; 0 where there is no socket
  bool socket_buffer_short = false;      // less than configured: raise net.core.rmem_max
  std::optional<Timestamp> last_frame_sensed_at;
};

enum class CameraDriver { kGige, kSim, kReplay };
enum class PixelFormat { kMono8, kMono12, kMono16 };

// Which instant the camera's own time stamp means.
enum class StampEvent { kExposureStart, kExposureEnd };

struct CameraConfig {
  CameraDriver driver = CameraDriver::kSim;

  // gige: IPv4 address. No discovery: it takes a second and finds the neighbour's camera.
  std::string address;
  int packet_size_bytes = 0;   // 0: found out by test packets when opening; else 576 .. 16000
  bool packet_socket = false;  // true needs root; under emulators it opens and never delivers
  int socket_buffer_bytes = 4'000'000;
  bool packet_resend = true;
  PixelFormat pixel_format = PixelFormat::kMono8;
  StampEvent stamp_event = StampEvent::kExposureEnd;
  double readout_latency_us = 0.0;  // from exposure end to the first packet on an idle network

  double frame_rate_hz = 10.0;
  double exposure_us = 5000.0;  // at the start; afterwards whatever RequestExposure asks for
  double exposure_min_us = 20.0;
  double exposure_max_us = 50'000.0;
  int silent_after_ms = 0;  // 0: three frame periods, but 200 ms at least

  // replay: the folder of a recorded run.
  std::string run_folder;  // Frame::frame_number is the row of frames.csv, from 1
  bool real_time = true;   // false: as fast as the caller asks
};

// A camera as one grabber thread uses it. WaitFrame opens, reconnects and closes by itself, so that
// everything that may block happens in that thread; RequestExposure and Health may be called from
// any thread.
class Camera {
 public:
  virtual ~Camera() = default;

  // The next exposure. Waits up to `timeout`; beyond it only while a connection is being opened
  // (GigE: 0.2 s, 3 s at worst, see gige_camera.h). No heap of ours in the frame
  // path. After a failure ask again: kEndOfRun and kBadRun are the only ones that stay.
  virtual Result<Frame, CameraFailure> WaitFrame(Duration timeout) = 0;

  // Takes effect at one of the next exposures; Frame::exposure_us tells at which. Clamped to the
  // limits of config and camera. Remembered over a reconnect. Ignored by replay.
  virtual void RequestExposure(double exposure_us) = 0;

  virtual CameraHealth Health() const = 0;

  // Ends the stream; the grabber thread calls it last. WaitFrame would open again.
  virtual void Close() = 0;
};

// Every fault of a config as one line "camera.<key>: <value>: what is right". Empty when it is
// good.
std::vector<std::string> CheckCameraConfig(const CameraConfig& config);

// The period without a frame after which the camera counts as silent.
Duration SilentAfter(const CameraConfig& config);

// `config` must have passed CheckCameraConfig. `clock` must outlive the camera. `world` is what the
// simulator looks at: needed by `sim`, ignored by the others.
std::unique_ptr<Camera> MakeCamera(const CameraConfig& config,
                                   const Clock& clock,
                                   std::shared_ptr<const sim::World> world = nullptr);

// Codes for logs and health topics: "streaming", "in_use".
std::string_view StateCode(CameraState state);
std::string_view FailureCode(CameraFailure failure);

}  // namespace tbm
