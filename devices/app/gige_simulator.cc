#include "devices/app/gige_simulator.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <arv.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace tbm {
namespace {

constexpr std::uint16_t kControlPort = 3956;
constexpr guint32 kVendorRegister = 0x48;
constexpr guint32 kModelRegister = 0x68;
constexpr std::size_t kNameBytes = 32;
// An image is begun this long before its frame leaves: long enough to render, short enough that the
// exposure the client has set last is honoured.
constexpr std::int64_t kRenderLeadNs = 30'000'000;

// A second camera on one address would start without an error and never hear a client, so the port
// is tried first.
std::optional<std::string> WhyNotFree(const std::string& address) {
  sockaddr_in own{};
  own.sin_family = AF_INET;
  own.sin_port = htons(kControlPort);
  if (inet_pton(AF_INET, address.c_str(), &own.sin_addr) != 1) {
    return fmt::format("--address {}: wanted an IPv4 address such as 127.0.0.1", address);
  }
  const int fd = socket(AF_INET, SOCK_DGRAM, 0);
  if (fd < 0) return fmt::format("no socket: {}", std::strerror(errno));
  const int result = bind(fd, reinterpret_cast<const sockaddr*>(&own), sizeof(own));
  const int error = errno;
  close(fd);
  if (result == 0) return std::nullopt;
  if (error == EADDRINUSE) {
    return fmt::format(
        "UDP port {} of {} is taken: another camera simulator runs there", kControlPort, address);
  }
  return fmt::format("UDP port {} of {}: {}", kControlPort, address, std::strerror(error));
}

void WriteName(ArvFakeCamera* camera, guint32 address, const char* name) {
  std::array<char, kNameBytes> field{};
  std::strncpy(field.data(), name, field.size() - 1);
  arv_fake_camera_write_memory(camera, address, kNameBytes, field.data());
}

}  // namespace

struct GigeSimulator::Machinery {
  struct Image {
    std::vector<std::uint8_t> pixels;
    std::int64_t end_ns = 0;  // of its exposure
  };

  Machinery(const GigeSimulatorOptions& options_in,
            std::shared_ptr<const sim::World> world,
            const sim::ViewOptions& view_options,
            std::function<void(const Shown&)> on_shown_in)
      : options(options_in),
        view(std::move(world), view_options),
        on_shown(std::move(on_shown_in)),
        shown{std::vector<std::uint8_t>(view.size_bytes()), g_get_real_time() * 1000},
        coming{shown},
        back{shown} {}

  ~Machinery() {
    renderer = std::jthread();  // stops and joins
    if (server != nullptr) g_object_unref(server);
  }

  void Configure() const;
  void RenderAhead(const std::stop_token& stop);
  void Fill(ArvBuffer* buffer);
  bool ShowComing();
  guint32 Register(guint32 address) const {
    guint32 value = 0;
    arv_fake_camera_read_register(camera, address, &value);
    return value;
  }

  const GigeSimulatorOptions options;
  sim::CameraView view;
  const std::function<void(const Shown&)> on_shown;
  ArvGvFakeCamera* server = nullptr;
  ArvFakeCamera* camera = nullptr;
  const guint64 powered_up_ns = static_cast<guint64>(g_get_real_time()) * 1000 - 1'000'000'000;

  std::mutex mutex;  // of all that follows
  Image shown;       // by the last frame
  Image coming;      // its exposure has not ended yet, or no frame has left since
  Image back;        // rendering thread's own between two swaps
  bool is_coming = false;
  std::int64_t sent_end_ns = 0;
  std::uint64_t sent = 0;
  std::uint64_t late = 0;

  std::jthread renderer;
};

void GigeSimulator::Machinery::Configure() const {
  const auto write = [this](guint32 address, double value) {
    arv_fake_camera_write_register(camera, address, static_cast<guint32>(value));
  };
  write(ARV_FAKE_CAMERA_REGISTER_SENSOR_WIDTH, view.width_px());
  write(ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT, view.height_px());
  write(ARV_FAKE_CAMERA_REGISTER_WIDTH, view.width_px());
  write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, view.height_px());
  write(ARV_FAKE_CAMERA_REGISTER_ACQUISITION_FRAME_PERIOD_US, 1e6 / options.frame_rate_hz);
  WriteName(camera, kVendorRegister, "TBM guidance");
  WriteName(camera, kModelRegister, "simulated-1280");
}

// Ends of exposures lie on whole multiples of the period of the system clock, where Aravis' fake
// camera sends its frames.
void GigeSimulator::Machinery::RenderAhead(const std::stop_token& stop) {
  std::int64_t last_end_ns = 0;
  while (!stop.stop_requested()) {
    using SystemTime = std::chrono::system_clock;
    const std::int64_t now_ns =
        std::chrono::duration_cast<Duration>(SystemTime::now().time_since_epoch()).count();
    const std::int64_t period_ns =
        1000 * std::max<std::int64_t>(
                   1000, Register(ARV_FAKE_CAMERA_REGISTER_ACQUISITION_FRAME_PERIOD_US));
    std::int64_t end_ns = (now_ns / period_ns + 1) * period_ns;
    if (end_ns == last_end_ns) end_ns += period_ns;
    const std::int64_t begin_ns = end_ns - std::min(kRenderLeadNs, period_ns / 2);
    if (now_ns < begin_ns) {
      // Short sleeps: the clock may be set, the rate changed, the program ended.
      std::this_thread::sleep_for(Duration(std::min<std::int64_t>(begin_ns - now_ns, 50'000'000)));
      continue;
    }
    last_end_ns = end_ns;
    const double exposure_us = Register(ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US);
    const Shown now_shown{{end_ns - static_cast<std::int64_t>(500.0 * exposure_us)}, exposure_us};
    view.Render(now_shown.sensed_at, now_shown.exposure_us, back.pixels.data());
    back.end_ns = end_ns;
    {
      const std::lock_guard lock(mutex);
      ShowComing();
      std::swap(coming, back);
      is_coming = true;
    }
    if (on_shown) on_shown(now_shown);
  }
}

// A frame that leaves late must not show an exposure that has not ended yet: its stamp would lie in
// the future, which no camera's does.
bool GigeSimulator::Machinery::ShowComing() {
  if (!is_coming || coming.end_ns > g_get_real_time() * 1000) return false;
  std::swap(shown, coming);
  is_coming = false;
  return true;
}

void GigeSimulator::Machinery::Fill(ArvBuffer* buffer) {
  const std::lock_guard lock(mutex);
  // Aravis knows the buffer's size only once it is filled, and hands it out as read-only although
  // this callback is there to write it.
  const std::size_t size = arv_fake_camera_get_payload(camera);
  auto* const bytes =
      static_cast<std::uint8_t*>(const_cast<void*>(arv_buffer_get_data(buffer, nullptr)));
  if (!ShowComing() && shown.end_ns == sent_end_ns) ++late;
  sent_end_ns = shown.end_ns;
  // The end of the image's exposure, however late this thread was woken. A camera counts from its
  // own power-up and knows nothing of civil time.
  arv_buffer_set_timestamp(buffer, static_cast<guint64>(shown.end_ns) - powered_up_ns);
  std::memcpy(bytes, shown.pixels.data(), std::min(size, shown.pixels.size()));
  ++sent;
  if (!options.stamp_sequence || size < 8) return;
  std::copy_n("TBM#", 4, bytes);
  for (std::size_t i = 0; i < 4; ++i) bytes[4 + i] = static_cast<std::uint8_t>(sent >> (8 * i));
}

GigeSimulator::GigeSimulator(std::unique_ptr<Machinery> machinery)
    : machinery_(std::move(machinery)) {}

GigeSimulator::~GigeSimulator() = default;

Result<std::unique_ptr<GigeSimulator>, std::string> GigeSimulator::Start(
    const GigeSimulatorOptions& options,
    std::shared_ptr<const sim::World> world,
    const sim::ViewOptions& view,
    std::function<void(const Shown&)> on_shown) {
  if (const auto why_not = WhyNotFree(options.address)) return Failure{*why_not};
  auto machinery =
      std::make_unique<Machinery>(options, std::move(world), view, std::move(on_shown));
  machinery->server = arv_gv_fake_camera_new(options.address.c_str(), options.serial.c_str());
  if (!arv_gv_fake_camera_is_running(machinery->server)) {
    return Failure{fmt::format("--address {}: no interface of this computer has this address",
                               options.address)};
  }
  {
    const std::lock_guard lock(machinery->mutex);
    machinery->camera = arv_gv_fake_camera_get_fake_camera(machinery->server);
  }
  g_object_set(machinery->server, "gvsp-lost-ratio", options.lost_packet_ratio, nullptr);
  machinery->Configure();
  const auto fill = +[](ArvBuffer* buffer, void* self, guint32, guint32, ArvPixelFormat) {
    static_cast<Machinery*>(self)->Fill(buffer);
  };
  arv_fake_camera_set_fill_pattern(machinery->camera, fill, machinery.get());
  Machinery* const m = machinery.get();
  m->renderer = std::jthread([m](const std::stop_token& stop) { m->RenderAhead(stop); });
  return std::unique_ptr<GigeSimulator>(new GigeSimulator(std::move(machinery)));
}

std::uint64_t GigeSimulator::frames_sent() const {
  const std::lock_guard lock(machinery_->mutex);
  return machinery_->sent;
}

std::uint64_t GigeSimulator::images_late() const {
  const std::lock_guard lock(machinery_->mutex);
  return machinery_->late;
}

}  // namespace tbm
