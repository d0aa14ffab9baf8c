#include "devices/total_station/asio_link.h"

#include <algorithm>
#include <array>
#include <utility>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/serial_port.hpp>
#include <boost/asio/write.hpp>

#include "devices/bus/serial_port.h"

namespace tbm {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;
using std::chrono::steady_clock;

// A request is a hundred bytes: if nobody takes them in this time the line is stuck.
constexpr std::chrono::milliseconds kWriteLimit(1000);

// What TCP and serial have in common. Both streams wait with epoll, so an idle line costs nothing.
template <class Stream>
class AsioLink : public ByteLink {
 public:
  void Close() override {
    error_code ignored;
    stream_.close(ignored);
  }
  bool IsOpen() const override { return stream_.is_open(); }

  std::optional<LinkFailure> Write(std::span<const std::uint8_t> bytes) override {
    if (!stream_.is_open()) return LinkFailure::kHungUp;
    std::optional<error_code> outcome;
    asio::async_write(stream_,
                      asio::buffer(bytes.data(), bytes.size()),
                      [&](const error_code& error, std::size_t) { outcome = error; });
    RunUntil(steady_clock::now() + kWriteLimit, outcome);
    if (!*outcome) return std::nullopt;
    return *outcome == asio::error::operation_aborted ? LinkFailure::kTimeout
                                                      : LinkFailure::kHungUp;
  }

  Result<std::size_t, LinkFailure> Read(std::span<std::uint8_t> into, SteadyTime until) override {
    if (!stream_.is_open()) return Failure{LinkFailure::kHungUp};
    std::optional<error_code> outcome;
    std::size_t count = 0;
    stream_.async_read_some(asio::buffer(into.data(), into.size()),
                            [&](const error_code& error, std::size_t received) {
                              outcome = error;
                              count = received;
                            });
    RunUntil(until, outcome);
    // Bytes that came while the wait was being called off are bytes.
    if (count > 0) return count;
    if (*outcome == asio::error::operation_aborted) return Failure{LinkFailure::kTimeout};
    return Failure{LinkFailure::kHungUp};
  }

  std::size_t Discard() override {
    std::size_t thrown = 0;
    std::array<std::uint8_t, 512> bytes{};
    while (stream_.is_open()) {
      const std::size_t waiting = std::min(BytesWaiting(stream_.native_handle()), bytes.size());
      error_code error;
      const std::size_t count =
          waiting == 0 ? 0 : stream_.read_some(asio::buffer(bytes.data(), waiting), error);
      if (count == 0 || error) break;
      thrown += count;
    }
    return thrown;
  }

 protected:
  AsioLink() : stream_(context_) {}

  // Runs the operation that sets `outcome`; calls it off at `until`. It is over when this returns.
  void RunUntil(SteadyTime until, const std::optional<error_code>& outcome) {
    context_.restart();
    while (!outcome && context_.run_one_until(until) > 0) {
    }
    if (outcome) return;
    error_code ignored;
    stream_.cancel(ignored);
    context_.restart();
    while (!outcome) context_.run_one();
  }

  asio::io_context context_{1};
  Stream stream_;
};

class TcpLink final : public AsioLink<asio::ip::tcp::socket> {
 public:
  TcpLink(std::string address, int port, Duration connect_timeout)
      : address_(std::move(address)), port_(port), connect_timeout_(connect_timeout) {}

  std::optional<LinkFailure> Open() override {
    Close();
    error_code error;
    const auto address = asio::ip::make_address(address_, error);
    if (error) return LinkFailure::kBadSettings;
    std::optional<error_code> outcome;
    stream_.async_connect({address, static_cast<std::uint16_t>(port_)},
                          [&](const error_code& connected) { outcome = connected; });
    RunUntil(steady_clock::now() + connect_timeout_, outcome);
    if (*outcome) {
      Close();
      return LinkFailure::kMissing;
    }
    error_code ignored;
    stream_.set_option(asio::ip::tcp::no_delay(true), ignored);
    stream_.set_option(asio::socket_base::keep_alive(true), ignored);
    return std::nullopt;
  }

 private:
  const std::string address_;
  const int port_;
  const Duration connect_timeout_;
};

class AsioSerialLink final : public AsioLink<asio::serial_port> {
 public:
  explicit AsioSerialLink(SerialSettings settings) : settings_(std::move(settings)) {}

  std::optional<LinkFailure> Open() override {
    Close();
    error_code error;
    stream_.open(settings_.path, error);
    if (error) return LinkFailureFromErrno(error.value());
    if (!LockPort(stream_.native_handle())) {
      Close();
      return LinkFailure::kBusy;
    }
    if (!Configure()) {
      Close();
      return LinkFailure::kBadSettings;
    }
    Discard();
    return std::nullopt;
  }

 private:
  bool Configure() {
    using Port = asio::serial_port_base;
    const auto parity = settings_.parity == Parity::kNone   ? Port::parity::none
                        : settings_.parity == Parity::kEven ? Port::parity::even
                                                            : Port::parity::odd;
    const auto stop_bits = settings_.stop_bits == 2 ? Port::stop_bits::two : Port::stop_bits::one;
    const auto set = [this](const auto& option) {
      error_code error;
      stream_.set_option(option, error);
      return !error;
    };
    return set(Port::baud_rate(static_cast<unsigned>(settings_.baud))) &&
           set(Port::character_size(8)) && set(Port::parity(parity)) &&
           set(Port::stop_bits(stop_bits)) && set(Port::flow_control(Port::flow_control::none));
  }

  const SerialSettings settings_;
};

}  // namespace

std::unique_ptr<ByteLink> MakeTcpLink(std::string address, int port, Duration connect_timeout) {
  return std::make_unique<TcpLink>(std::move(address), port, connect_timeout);
}

std::unique_ptr<ByteLink> MakeAsioSerialLink(SerialSettings settings) {
  return std::make_unique<AsioSerialLink>(std::move(settings));
}

}  // namespace tbm
