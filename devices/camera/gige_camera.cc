#include "devices/camera/gige_camera.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <thread>
#include <utility>

#include <arv.h>
#include <fmt/format.h>

#include "devices/camera/gvcp_probe.h"
#include "pose/base/check.h"

namespace tbm {
namespace {

constexpr double kNoRequest = std::numeric_limits<double>::quiet_NaN();
constexpr Duration kProbeTimeout = std::chrono::milliseconds(200);
// Between two looks at the flag that the control channel is lost.
constexpr Duration kSlice = std::chrono::milliseconds(100);
// Older than this in the queue between Aravis and us is no arrival but a clock that was set.
constexpr Duration kOldestFrame = std::chrono::seconds(2);

struct Unref {
  void operator()(void* object) const { g_object_unref(object); }
};
template <class T>
using GPtr = std::unique_ptr<T, Unref>;

// Holds the error of a chain of Aravis calls: after the first failure the rest is skipped.
class Steps {
 public:
  ~Steps() { g_clear_error(&error_); }
  Steps() = default;
  Steps(const Steps&) = delete;
  Steps& operator=(const Steps&) = delete;

  template <class Call>
  auto Do(const char* what, Call call) {
    using Value = decltype(call(&error_));
    if constexpr (std::is_void_v<Value>) {
      if (error_ != nullptr) return;
      call(&error_);
      if (error_ != nullptr) what_ = what;
    } else {
      if (error_ != nullptr) return Value{};
      Value value = call(&error_);
      if (error_ != nullptr) what_ = what;
      return value;
    }
  }

  // A feature that some cameras do not have: its failure changes nothing.
  template <class Call>
  void Try(Call call) {
    if (error_ != nullptr) return;
    GError* ignored = nullptr;
    call(&ignored);
    g_clear_error(&ignored);
  }

  bool ok() const { return error_ == nullptr; }
  std::string Text() const { return fmt::format("{}: {}", what_, error_->message); }
  CameraFailure Failure() const {
    return g_error_matches(error_, ARV_DEVICE_ERROR, ARV_DEVICE_ERROR_TIMEOUT)
               ? CameraFailure::kUnreachable
               : CameraFailure::kRefused;
  }

 private:
  GError* error_ = nullptr;
  const char* what_ = "";
};

ArvPixelFormat AravisFormat(PixelFormat format) {
  switch (format) {
    case PixelFormat::kMono8:
      return ARV_PIXEL_FORMAT_MONO_8;
    case PixelFormat::kMono12:
      return ARV_PIXEL_FORMAT_MONO_12;
    case PixelFormat::kMono16:
      return ARV_PIXEL_FORMAT_MONO_16;
  }
  return ARV_PIXEL_FORMAT_MONO_8;
}

std::uint32_t FullScale(PixelFormat format) {
  switch (format) {
    case PixelFormat::kMono8:
      return 255;
    case PixelFormat::kMono12:
      return 4095;
    case PixelFormat::kMono16:
      return 65535;
  }
  return 255;
}

Duration Microseconds(double us) { return Duration(std::llround(us * 1000.0)); }

GPtr<ArvDevice> OpenDevice(const std::string& address, Steps& steps) {
  GPtr<GInetAddress> camera(g_inet_address_new_from_string(address.c_str()));
  GPtr<GInetAddress> own(g_inet_address_new_from_string(InterfaceTowards(address).c_str()));
  if (!camera || !own) return nullptr;
  return GPtr<ArvDevice>(steps.Do("opening the control channel", [&](GError** error) {
    return arv_gv_device_new(own.get(), camera.get(), error);
  }));
}

}  // namespace

struct GigeCamera::Connection {
  GPtr<ArvDevice> device;
  GPtr<ArvCamera> camera;
  GPtr<ArvStream> stream;
  ArvBuffer* lent = nullptr;
  gulong control_lost_handler = 0;
  std::atomic<bool> is_control_lost = false;
  bool is_answering = false;        // when it is closed: a dead camera need not be told to stop
  std::uint64_t resent_before = 0;  // counted by the streams before this one
  bool had_frame = false;
  double exposure_min_us = 0.0;
  double exposure_max_us = 0.0;

  void ReturnLent() {
    if (lent != nullptr) arv_stream_push_buffer(stream.get(), std::exchange(lent, nullptr));
  }

  void WatchControl() {
    const auto on_lost = +[](ArvDevice*, void* self) {
      static_cast<Connection*>(self)->is_control_lost.store(true);
    };
    control_lost_handler =
        g_signal_connect(device.get(), "control-lost", G_CALLBACK(on_lost), this);
  }

  void Configure(const CameraConfig& config, double exposure_us, Steps& steps);
  void StartStream(const CameraConfig& config, Steps& steps);
  double SetExposure(double exposure_us, Steps& steps);

  ~Connection() {
    if (control_lost_handler != 0) g_signal_handler_disconnect(device.get(), control_lost_handler);
    ReturnLent();
    if (camera && stream && is_answering) arv_camera_stop_acquisition(camera.get(), nullptr);
    stream.reset();
    camera.reset();
    device.reset();
  }
};

void GigeCamera::Connection::Configure(const CameraConfig& config,
                                       double exposure_us,
                                       Steps& steps) {
  ArvCamera* c = camera.get();
  // Whoever used the camera last may have left it running, triggered, or regulating by itself.
  steps.Try([&](GError** e) { arv_camera_stop_acquisition(c, e); });
  steps.Try([&](GError** e) { arv_camera_clear_triggers(c, e); });
  steps.Try([&](GError** e) { arv_camera_set_exposure_time_auto(c, ARV_AUTO_OFF, e); });
  steps.Try([&](GError** e) { arv_camera_set_gain_auto(c, ARV_AUTO_OFF, e); });

  steps.Do("pixel format", [&](GError** e) {
    arv_camera_set_pixel_format(c, AravisFormat(config.pixel_format), e);
  });
  steps.Do("continuous acquisition", [&](GError** e) {
    arv_camera_set_acquisition_mode(c, ARV_ACQUISITION_MODE_CONTINUOUS, e);
  });
  steps.Do("limits of the exposure", [&](GError** e) {
    arv_camera_get_exposure_time_bounds(c, &exposure_min_us, &exposure_max_us, e);
  });
  exposure_min_us = std::max(exposure_min_us, config.exposure_min_us);
  exposure_max_us = std::min(exposure_max_us, config.exposure_max_us);
  SetExposure(exposure_us, steps);
  steps.Do("frame rate",
           [&](GError** e) { arv_camera_set_frame_rate(c, config.frame_rate_hz, e); });
  steps.Do("packet size", [&](GError** e) {
    if (config.packet_size_bytes == 0) {
      arv_camera_gv_auto_packet_size(c, e);
    } else {
      arv_camera_gv_set_packet_size(c, config.packet_size_bytes, e);
    }
  });
  arv_camera_gv_set_packet_size_adjustment(c, ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
  arv_camera_gv_set_stream_options(c,
                                   config.packet_socket
                                       ? ARV_GV_STREAM_OPTION_NONE
                                       : ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
}

void GigeCamera::Connection::StartStream(const CameraConfig& config, Steps& steps) {
  stream.reset(steps.Do("opening the stream", [&](GError** e) {
    return arv_camera_create_stream(camera.get(), nullptr, nullptr, e);
  }));
  const guint payload =
      steps.Do("image size", [&](GError** e) { return arv_camera_get_payload(camera.get(), e); });
  if (!steps.ok()) return;
  g_object_set(
      stream.get(),
      "socket-buffer",
      ARV_GV_STREAM_SOCKET_BUFFER_FIXED,
      "socket-buffer-size",
      config.socket_buffer_bytes,
      "packet-resend",
      config.packet_resend ? ARV_GV_STREAM_PACKET_RESEND_ALWAYS : ARV_GV_STREAM_PACKET_RESEND_NEVER,
      nullptr);
  for (int i = 0; i < kBuffers; ++i) {
    arv_stream_push_buffer(stream.get(), arv_buffer_new_allocate(payload));
  }
  steps.Do("start", [&](GError** e) { arv_camera_start_acquisition(camera.get(), e); });
}

// Returns what the camera made of it: it rounds to its own step.
double GigeCamera::Connection::SetExposure(double exposure_us, Steps& steps) {
  const double clamped_us = std::max(exposure_min_us, std::min(exposure_us, exposure_max_us));
  steps.Do("exposure",
           [&](GError** e) { arv_camera_set_exposure_time(camera.get(), clamped_us, e); });
  return steps.Do("exposure",
                  [&](GError** e) { return arv_camera_get_exposure_time(camera.get(), e); });
}

GigeCamera::GigeCamera(const CameraConfig& config, const Clock& clock)
    : config_(config),
      clock_(clock),
      life_(SilentAfter(config)),
      requested_us_(kNoRequest),
      wanted_us_(config.exposure_us),
      exposure_us_(config.exposure_us) {}

GigeCamera::~GigeCamera() { Close(); }

void GigeCamera::RequestExposure(double exposure_us) { requested_us_.store(exposure_us); }

Result<Frame, CameraFailure> GigeCamera::WaitFrame(Duration timeout) {
  if (connection_) connection_->ReturnLent();
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  if (const auto failure = OpenWhenDue(timeout)) return Failure{*failure};

  for (;;) {
    if (connection_->is_control_lost.load()) {
      return Failure{Drop(CameraFailure::kLost, "the camera stopped answering or was taken over")};
    }
    ApplyExposure();
    const Duration left = deadline - std::chrono::steady_clock::now();
    if (const auto frame = NextFrame(std::clamp(left, Duration::zero(), kSlice))) return *frame;

    const auto now = std::chrono::steady_clock::now();
    life_.GotNothing(now);
    if (life_.ShouldAsk(now)) {
      if (AnswersDiscovery(config_.address, kProbeTimeout)) {
        return Failure{Drop(CameraFailure::kLost, "the camera answers but sends no frames")};
      }
      life_.Asked(now);
    }
    if (now < deadline) continue;
    if (life_.state() != CameraState::kSilent) return Failure{CameraFailure::kNoFrameInTime};
    board_.Fail(CameraState::kSilent, CameraFailure::kSilent, "no frame in time");
    return Failure{CameraFailure::kSilent};
  }
}

std::optional<CameraFailure> GigeCamera::OpenWhenDue(Duration timeout) {
  if (connection_) return std::nullopt;
  const Duration until = life_.UntilOpening(std::chrono::steady_clock::now());
  std::this_thread::sleep_for(std::min(until, timeout));
  if (until > timeout) return last_failure_;
  if (!IsFarewellOver(timeout - std::max(until, Duration::zero()))) return last_failure_;

  life_.Opening();
  board_.Update([](CameraHealth& health) { health.state = CameraState::kOpening; });
  const auto failure = Open();
  const auto now = std::chrono::steady_clock::now();
  if (failure) {
    life_.OpeningFailed(now);
    last_failure_ = *failure;
    return failure;
  }
  life_.Opened(now);
  board_.Update([&](CameraHealth& health) {
    health.state = CameraState::kStreaming;
    health.failure.reset();
    health.detail.clear();
    health.exposure_us = exposure_us_;
    if (was_open_) ++health.reconnects;
  });
  was_open_ = true;
  ReportSocketBuffer();
  return std::nullopt;
}

std::optional<CameraFailure> GigeCamera::Open() {
  const auto fail = [this](CameraFailure failure, const std::string& detail) {
    board_.Fail(CameraState::kClosed, failure, detail);
    return failure;
  };
  if (!AnswersDiscovery(config_.address, kProbeTimeout)) {
    return fail(CameraFailure::kUnreachable,
                fmt::format("no GigE Vision camera answers at {}", config_.address));
  }
  Steps steps;
  auto connection = std::make_unique<Connection>();
  connection->device = OpenDevice(config_.address, steps);
  if (steps.ok() && !connection->device) {
    return fail(CameraFailure::kUnreachable, fmt::format("no route to {}", config_.address));
  }
  if (steps.ok() && !arv_gv_device_is_controller(ARV_GV_DEVICE(connection->device.get()))) {
    return fail(CameraFailure::kInUse,
                fmt::format("another program controls the camera at {}", config_.address));
  }
  connection->camera.reset(steps.Do("reading the camera's description", [&](GError** error) {
    return arv_camera_new_with_device(connection->device.get(), error);
  }));
  if (steps.ok()) connection->WatchControl();
  if (steps.ok()) connection->Configure(config_, wanted_us_, steps);
  if (steps.ok()) connection->StartStream(config_, steps);
  if (!steps.ok()) return fail(steps.Failure(), steps.Text());

  exposure_us_ = arv_camera_get_exposure_time(connection->camera.get(), nullptr);
  coming_us_.reset();
  ids_.Restart();
  camera_clock_.Restart();
  const int packet_size_bytes =
      static_cast<int>(arv_camera_gv_get_packet_size(connection->camera.get(), nullptr));
  board_.Update([&](CameraHealth& health) { health.packet_size_bytes = packet_size_bytes; });
  connection->resent_before = board_.Read().resent_packets;
  connection_ = std::move(connection);
  return std::nullopt;
}

void GigeCamera::ReportSocketBuffer() {
  const std::int64_t wanted_bytes = config_.socket_buffer_bytes;
  const std::int64_t granted_bytes = GrantedSocketBuffer(config_.socket_buffer_bytes);
  board_.Update([&](CameraHealth& health) {
    health.socket_buffer_bytes = granted_bytes;
    health.socket_buffer_short = granted_bytes < wanted_bytes;
  });
}

std::optional<Frame> GigeCamera::NextFrame(Duration timeout) {
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(timeout).count();
  ArvBuffer* const buffer =
      us > 0 ? arv_stream_timeout_pop_buffer(connection_->stream.get(), static_cast<guint64>(us))
             : arv_stream_try_pop_buffer(connection_->stream.get());
  if (buffer == nullptr) return std::nullopt;
  auto frame = Deliver(buffer);
  if (!frame) {
    arv_stream_push_buffer(connection_->stream.get(), buffer);
    return std::nullopt;
  }
  connection_->lent = buffer;
  life_.GotFrame(std::chrono::steady_clock::now());
  return frame;
}

// Nothing for buffers that hold no exposure: given back at a stop, or a frame counted before.
std::optional<Frame> GigeCamera::Deliver(void* opaque) {
  auto* const buffer = static_cast<ArvBuffer*>(opaque);
  const ArvBufferStatus status = arv_buffer_get_status(buffer);
  if (status == ARV_BUFFER_STATUS_ABORTED || status == ARV_BUFFER_STATUS_CLEARED ||
      status == ARV_BUFFER_STATUS_UNKNOWN) {
    return std::nullopt;
  }
  const FrameIdCounter::Step step = ids_.Count(arv_buffer_get_frame_id(buffer));
  if (step.is_late) return std::nullopt;

  Frame frame;
  frame.frame_number = step.frame_number;
  frame.fault = FrameFault::kMissingPackets;
  // Of a frame with holes the library does not even say how large its image is.
  if (status == ARV_BUFFER_STATUS_SUCCESS) FillImage(buffer, frame);
  FillTimes(buffer, frame);
  CountFrame(frame, step, !std::exchange(connection_->had_frame, true));
  return frame;
}

// Leaves the image empty, and the frame incomplete, when the buffer is not what was asked for.
void GigeCamera::FillImage(void* opaque, Frame& frame) const {
  auto* const buffer = static_cast<ArvBuffer*>(opaque);
  if (arv_buffer_get_payload_type(buffer) != ARV_BUFFER_PAYLOAD_TYPE_IMAGE ||
      arv_buffer_get_image_pixel_format(buffer) != AravisFormat(config_.pixel_format)) {
    return;
  }
  size_t size = 0;
  const void* const pixels = arv_buffer_get_image_data(buffer, &size);
  gint x = 0, y = 0, width = 0, height = 0, x_padding = 0, y_padding = 0;
  arv_buffer_get_image_region(buffer, &x, &y, &width, &height);
  arv_buffer_get_image_padding(buffer, &x_padding, &y_padding);
  const int bytes_per_pixel = config_.pixel_format == PixelFormat::kMono8 ? 1 : 2;
  const std::ptrdiff_t stride = std::ptrdiff_t{width} * bytes_per_pixel + x_padding;
  if (pixels == nullptr || width <= 0 || height <= 0 ||
      static_cast<size_t>(stride) * static_cast<size_t>(height) > size) {
    return;
  }
  frame.image = {pixels, width, height, stride, bytes_per_pixel, FullScale(config_.pixel_format)};
  frame.fault = FrameFault::kNone;
}

void GigeCamera::FillTimes(void* opaque, Frame& frame) {
  auto* const buffer = static_cast<ArvBuffer*>(opaque);
  // All is reckoned on the steady clock and told in the civil time of this moment, so that the
  // stamps follow at once when somebody sets the clock. Only a frame on its way just then has no
  // arrival.
  const Duration civil_ahead = CivilMinusSteady(clock_);
  const auto now = clock_.Steady();
  const auto civil = [&](CameraClock::SteadyTime at) {
    return Timestamp{} + (at.time_since_epoch() + civil_ahead);
  };
  const Timestamp stamped_by_aravis{
      static_cast<std::int64_t>(arv_buffer_get_system_timestamp(buffer))};
  const Duration age = civil(now) - stamped_by_aravis;
  const bool is_plausible = age > Duration::zero() && age < kOldestFrame;
  const auto received = is_plausible ? now - age : now;
  frame.received_at = civil(received);
  auto stamp_ns = static_cast<std::int64_t>(arv_buffer_get_timestamp(buffer));
  const bool is_stamped = stamp_ns != 0;
  if (config_.stamp_event == StampEvent::kExposureStart) {
    stamp_ns += Microseconds(exposure_us_).count();
  }
  const auto seen = is_stamped ? camera_clock_.ToHost(stamp_ns, received) : received;
  const auto exposed_until = seen - Microseconds(config_.readout_latency_us);

  if (coming_us_ && exposed_until - Microseconds(*coming_us_) >= coming_from_) {
    exposure_us_ = *coming_us_;
    coming_us_.reset();
  }
  frame.exposure_us = exposure_us_;
  frame.sensed_at = civil(exposed_until - Microseconds(exposure_us_ / 2.0));
}

void GigeCamera::CountFrame(const Frame& frame, const FrameIdCounter::Step& step, bool is_first) {
  guint64 resent = 0;
  guint64 missing = 0;
  arv_gv_stream_get_statistics(ARV_GV_STREAM(connection_->stream.get()), &resent, &missing);
  board_.Update([&](CameraHealth& health) {
    health.state = CameraState::kStreaming;
    health.failure.reset();
    ++health.frames;
    health.lost += step.lost;
    if (!frame.complete() && !is_first) ++health.incomplete;
    health.resent_packets = connection_->resent_before + resent;
    health.exposure_us = frame.exposure_us;
    health.last_frame_sensed_at = frame.sensed_at;
  });
}

void GigeCamera::ApplyExposure() {
  const double requested_us = requested_us_.exchange(kNoRequest);
  if (std::isnan(requested_us)) return;
  wanted_us_ = requested_us;
  Steps steps;
  const double granted_us = connection_->SetExposure(wanted_us_, steps);
  if (!steps.ok()) {
    board_.Update([&](CameraHealth& health) { health.detail = steps.Text(); });
    return;
  }
  coming_us_ = granted_us;
  coming_from_ = clock_.Steady();
}

CameraFailure GigeCamera::Drop(CameraFailure why, const std::string& detail) {
  Disconnect();
  last_failure_ = why;
  board_.Fail(CameraState::kClosed, why, detail);
  return why;
}

void GigeCamera::Disconnect() {
  connection_->is_answering =
      !connection_->is_control_lost.load() && AnswersDiscovery(config_.address, kProbeTimeout);
  if (connection_->is_answering) {
    connection_.reset();
  } else {
    std::packaged_task<void()> farewell(
        [connection = std::move(connection_)]() mutable { connection.reset(); });
    farewell_ = farewell.get_future();
    farewell_began_ = std::chrono::steady_clock::now();
    std::thread(std::move(farewell)).detach();
  }
  life_.Lost(std::chrono::steady_clock::now());
}

bool GigeCamera::IsFarewellOver(Duration patience) {
  if (!farewell_.valid()) return true;
  if (farewell_.wait_for(patience) != std::future_status::ready) return false;
  farewell_ = {};
  return true;
}

void GigeCamera::Close() {
  if (connection_) {
    Disconnect();
    board_.Update([](CameraHealth& health) { health.state = CameraState::kClosed; });
  }
  (void)IsFarewellOver(std::max(
      Duration::zero(), farewell_began_ + kFarewellPatience - std::chrono::steady_clock::now()));
}

}  // namespace tbm
