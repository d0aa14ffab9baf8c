#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <netinet/in.h>

#include "tests/support/random.h"

namespace tbm::test {

// A bad network between a GigE Vision camera and its client, on the loopback interface: the client
// opens `own_address`, the proxy talks to the camera at `camera_address`. Control packets that name
// the stream's destination are rewritten, so images come through here too. Unlike Aravis' fake
// camera it answers requests to resend packets. All knobs may be turned while it runs.
class GvProxy {
 public:
  GvProxy(std::string own_address, std::string camera_address, const std::string& stream);
  ~GvProxy();
  GvProxy(const GvProxy&) = delete;
  GvProxy& operator=(const GvProxy&) = delete;

  bool is_up() const { return control_ >= 0 && stream_ >= 0; }
  const std::string& address() const { return own_address_; }

  // Parts of the stream's packets.
  std::atomic<double> drop = 0.0;
  std::atomic<double> duplicate = 0.0;
  std::atomic<double> reorder = 0.0;  // swapped with the next one
  std::atomic<double> corrupt = 0.0;  // one payload byte changed
  std::atomic<double> control_drop = 0.0;
  std::atomic<bool> is_black_hole = false;  // nothing passes, either way
  std::atomic<bool> answers_resend = true;

  std::uint64_t dropped() const { return dropped_.load(); }
  std::uint64_t resent() const { return resent_.load(); }

 private:
  using Bytes = std::vector<std::uint8_t>;

  void Run(const std::stop_token& stop);
  void FromClient(Bytes& packet);
  void FromCamera(Bytes& packet);
  void FromStream(Bytes& packet);
  void RewriteDestination(Bytes& packet);
  void Resend(const Bytes& request);
  void Remember(const Bytes& packet);
  void SendStream(const Bytes& packet);
  bool Happens(double probability) { return probability > 0.0 && random_.Unit() < probability; }

  const std::string own_address_;
  Random random_;
  int control_ = -1;   // bound to own_address:3956, where the client asks
  int upstream_ = -1;  // connected to the camera's control port
  int stream_ = -1;    // where the camera sends images
  std::uint16_t stream_port_ = 0;
  sockaddr_in client_control_{};
  sockaddr_in client_stream_{};
  std::map<std::uint16_t, std::uint32_t> asked_register_;      // request id -> register
  std::map<std::uint16_t, std::vector<Bytes>> recent_frames_;  // by packet id
  std::vector<std::uint16_t> frame_order_;
  std::optional<Bytes> held_;  // for reorder
  std::atomic<std::uint64_t> dropped_ = 0;
  std::atomic<std::uint64_t> resent_ = 0;
  std::jthread thread_;
};

}  // namespace tbm::test
