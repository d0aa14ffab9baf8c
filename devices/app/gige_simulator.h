#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "devices/sim/camera_view.h"
#include "devices/sim/world.h"
#include "pose/base/result.h"
#include "pose/base/time.h"

namespace tbm {

struct GigeSimulatorOptions {
  std::string address = "127.0.0.1";  // of an interface of this computer
  std::string serial = "TBM01";
  double frame_rate_hz = 10.0;     // until the client sets another
  bool stamp_sequence = false;     // frame's first bytes: "TBM#", then a 32-bit little-endian count
  double lost_packet_ratio = 0.0;  // the camera's own; it does not answer requests to resend
};

// What was shown, told by the rendering thread after each image.
struct Shown {
  Timestamp sensed_at;
  double exposure_us = 0.0;
};

// A GigE Vision camera on this computer: control and stream protocol by Aravis' fake camera, images
// of a simulated world. Frames leave at whole multiples of the frame period of the system clock;
// the image in a frame is of the exposure that ended there.
//
// A thread of its own renders ahead; the protocol's thread only copies a finished image, because it
// also has to answer heartbeats. A frame for which no image is ready repeats the one before, with
// its stamp. The first frame leaves as soon as the client starts, with an image up to one period
// old.
class GigeSimulator {
 public:
  // The message says what is wrong and what to do: the address may be unknown here, or its control
  // port taken by another program.
  static Result<std::unique_ptr<GigeSimulator>, std::string> Start(
      const GigeSimulatorOptions& options,
      std::shared_ptr<const sim::World> world,
      const sim::ViewOptions& view,
      std::function<void(const Shown&)> on_shown = {});
  ~GigeSimulator();
  GigeSimulator(const GigeSimulator&) = delete;
  GigeSimulator& operator=(const GigeSimulator&) = delete;

  std::uint64_t frames_sent() const;
  std::uint64_t images_late() const;  // frames that had to show the image before

 private:
  struct Machinery;
  explicit GigeSimulator(std::unique_ptr<Machinery> machinery);

  std::unique_ptr<Machinery> machinery_;
};

}  // namespace tbm
