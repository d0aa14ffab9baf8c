#include "hmi_bridge/server/web_sockets.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <deque>
#include <mutex>
#include <string>

#include <boost/asio/bind_executor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include "hmi_bridge/server/live_feed.h"

namespace tbm::hmi {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;
using std::chrono::steady_clock;

// The session behind the socket has ended: the page shows the log-in.
constexpr auto kSessionEnded = static_cast<websocket::close_code>(4401);
// How often it is looked whether it has.
constexpr std::chrono::milliseconds kLookEvery(1000);

// What has left for the kernel cannot be overtaken: it may hold little, or a slow client would get
// what was new seconds ago.
void KeepLittleInKernel(WireStream& stream) {
  const int handle = stream.socket().native_handle();
  const int unsent_bytes = 16 * 1024;
  const int buffer_bytes = 128 * 1024;
  setsockopt(handle, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &unsent_bytes, sizeof unsent_bytes);
  setsockopt(handle, SOL_SOCKET, SO_SNDBUF, &buffer_bytes, sizeof buffer_bytes);
}

// What both kinds have in common: opening, one write in flight, reading what a client says,
// leaving. All but Poke and Offer runs on the connection's strand.
class Socket : public OpenSocket, public std::enable_shared_from_this<Socket> {
 public:
  Socket(ServerShared& shared, WireStream stream, Identity identity)
      : shared_(shared),
        socket_(std::move(stream)),
        timer_(socket_.get_executor()),
        identity_(std::move(identity)) {
    KeepLittleInKernel(socket_.next_layer());
  }
  ~Socket() override { shared_.Remove(this); }

  void Open(const BeastRequest& request, const std::string& subprotocol, std::size_t most_bytes) {
    websocket::stream_base::timeout limits{};
    limits.handshake_timeout = shared_.options.limits.request;
    limits.idle_timeout = shared_.options.limits.silence;
    limits.keep_alive_pings = true;
    socket_.set_option(limits);
    const bool is_tls = socket_.next_layer().is_tls();
    socket_.set_option(
        websocket::stream_base::decorator([subprotocol, is_tls](websocket::response_type& answer) {
          for (const auto& [name, value] : SecurityHeaders(is_tls)) {
            answer.set(beast::string_view(name.data(), name.size()),
                       beast::string_view(value.data(), value.size()));
          }
          answer.set(beast::http::field::sec_websocket_protocol, subprotocol);
        }));
    socket_.read_message_max(most_bytes);
    socket_.auto_fragment(false);
    socket_.async_accept(request, [self = shared_from_this()](error_code error) {
      if (error) return;
      self->shared_.Add(self.get(), self);
      self->is_open_ = true;
      self->Read();
      self->OnOpen();
    });
  }

 protected:
  virtual void OnOpen() = 0;
  virtual void OnClient(bool is_text, std::string_view message) = 0;
  virtual void OnWritten(std::size_t bytes) = 0;
  virtual void OnTimer() = 0;

  template <class Buffers>
  void Write(bool is_text, const Buffers& buffers) {
    is_writing_ = true;
    WakeAt(steady_clock::now() + shared_.options.limits.write);
    socket_.text(is_text);
    socket_.async_write(buffers, [self = shared_from_this()](error_code error, std::size_t bytes) {
      self->is_writing_ = false;
      if (error) return self->Drop();
      if (!self->is_leaving_) self->OnWritten(bytes);
    });
  }

  void WakeAt(steady_clock::time_point when) {
    timer_.expires_at(when);
    timer_.async_wait([self = shared_from_this()](error_code error) {
      if (error || !self->socket_.next_layer().socket().is_open()) return;
      // Set anew after this had expired already.
      if (self->timer_.expiry() > steady_clock::now()) return;
      if (self->is_writing_ || self->is_leaving_) {
        self->shared_.counters.Refuse(Refusal::kTimeout);
        return self->Drop();
      }
      self->OnTimer();
    });
  }

  // Whether the session behind it still is one; else takes leave.
  bool IsAllowed() {
    if (is_leaving_) return false;
    if (shared_.auth.StillHolds(identity_)) return true;
    is_leaving_ = true;
    WakeAt(steady_clock::now() + shared_.options.limits.write);
    socket_.async_close(websocket::close_reason(kSessionEnded, "session_ended"),
                        [self = shared_from_this()](error_code) { self->Drop(); });
    return false;
  }

  void Drop() {
    is_leaving_ = true;
    timer_.cancel();
    socket_.next_layer().Close();
  }

  bool is_writing() const { return is_writing_; }
  bool is_leaving() const { return is_leaving_; }
  asio::any_io_executor executor() { return socket_.get_executor(); }

  ServerShared& shared_;

 private:
  void Read() {
    socket_.async_read(buffer_, [self = shared_from_this()](error_code error, std::size_t) {
      if (error == beast::error::timeout) self->shared_.counters.Refuse(Refusal::kTimeout);
      if (error && error != websocket::error::closed && error != asio::error::eof &&
          error.category() != asio::error::get_system_category() &&
          error != beast::error::timeout) {
        self->shared_.counters.Refuse(Refusal::kMalformed);
      }
      if (error) return self->Drop();
      const auto data = self->buffer_.data();
      self->OnClient(self->socket_.got_text(),
                     {static_cast<const char*>(data.data()), data.size()});
      self->buffer_.consume(self->buffer_.size());
      self->Read();
    });
  }

  websocket::stream<WireStream, false> socket_;
  asio::steady_timer timer_;
  beast::flat_buffer buffer_;
  const Identity identity_;
  bool is_open_ = false;
  bool is_writing_ = false;
  bool is_leaving_ = false;
};

// /api/live.
class LiveSocket final : public Socket {
 public:
  LiveSocket(ServerShared& shared, WireStream stream, Identity identity)
      : Socket(shared, std::move(stream), std::move(identity)) {
    ++shared_.counters.live_clients;
  }
  ~LiveSocket() override { --shared_.counters.live_clients; }

  void Poke() override {
    // One is enough until it has been looked at.
    if (is_poked_.exchange(true)) return;
    asio::post(executor(), [self = shared_from_this(), this] {
      is_poked_ = false;
      if (has_news_ && !IsPutOff()) return;
      has_news_ = true;
      news_at_ = steady_clock::now();
      if (!is_writing() && !is_leaving()) Plan();
    });
  }
  void Offer(const std::shared_ptr<const Sample>&) override {}

 protected:
  void OnOpen() override { Send(); }
  void OnClient(bool, std::string_view) override {}
  void OnTimer() override { Send(); }
  void OnWritten(std::size_t bytes) override {
    ++shared_.counters.live_messages;
    shared_.counters.live_bytes += bytes;
    Plan();
  }

 private:
  void Plan() {
    const auto& limits = shared_.options.limits;
    const auto due = has_news_ ? DueForNews() : sent_at_ + limits.heartbeat;
    if (due <= steady_clock::now()) return Send();
    WakeAt(due);
  }
  // News that comes as often as may be sent would wait as long each time, up to a whole period, if
  // it came just behind a message once. Then the next news is waited for and goes out with it at
  // once: one message is late and all later ones are not.
  bool IsPutOff() const {
    const auto& limits = shared_.options.limits;
    return sent_at_ + limits.live_period > news_at_ + limits.gather + limits.live_period / 5;
  }
  steady_clock::time_point DueForNews() const {
    const auto& limits = shared_.options.limits;
    if (IsPutOff()) return sent_at_ + 2 * limits.live_period;
    return std::max(sent_at_ + limits.live_period, news_at_ + limits.gather);
  }
  void Send() {
    if (!IsAllowed()) return;
    // Before it is asked: what comes while it answers is news again.
    has_news_ = false;
    sent_at_ = steady_clock::now();
    const std::string& text = feed_.Next(shared_.source.Now());
    Write(true, asio::buffer(text));
  }

  LiveFeed feed_;
  std::atomic<bool> is_poked_{false};
  bool has_news_ = false;
  steady_clock::time_point news_at_{};
  steady_clock::time_point sent_at_{};
};

// /foxglove.
class FoxgloveSocket final : public Socket {
 public:
  FoxgloveSocket(ServerShared& shared, WireStream stream, Identity identity)
      : Socket(shared, std::move(stream), std::move(identity)),
        subscriptions_(shared.raw.Channels().size()),
        samples_(shared.options.limits.waiting_samples, shared.options.limits.waiting_bytes) {
    ++shared_.counters.foxglove_clients;
  }
  ~FoxgloveSocket() override {
    for (const std::size_t channel : subscriptions_.Channels()) --shared_.listeners[channel];
    --shared_.counters.foxglove_clients;
  }

  void Poke() override {}
  void Offer(const std::shared_ptr<const Sample>& sample) override {
    bool is_wanted = false;
    {
      const std::lock_guard lock(mutex_);
      subscriptions_.Each(sample->channel, [&](std::uint32_t id) {
        is_wanted = true;
        const std::size_t dropped = samples_.Push({id, sample});
        dropped_ += dropped;
        shared_.counters.foxglove_dropped += dropped;
      });
      if (!is_wanted || is_pumping_) return;
      is_pumping_ = true;
    }
    asio::post(executor(), [self = shared_from_this(), this] { Pump(); });
  }

 protected:
  void OnOpen() override {
    texts_.push_back(FoxgloveServerInfo(shared_.options.product, shared_.run));
    texts_.push_back(FoxgloveAdvertise(shared_.raw.Channels()));
    Pump();
  }
  void OnClient(bool is_text, std::string_view message) override {
    FoxgloveSubscriptions::Outcome outcome;
    {
      const std::lock_guard lock(mutex_);
      outcome = is_text ? subscriptions_.TakeText(message) : subscriptions_.TakeBinary();
    }
    for (const std::size_t channel : outcome.begun) ++shared_.listeners[channel];
    for (const std::size_t channel : outcome.ended) --shared_.listeners[channel];
    // Who asks nonsense without reading the answers is not told each time.
    constexpr std::size_t kMostTexts = 64;
    for (std::string& answer : outcome.answers) {
      if (texts_.size() < kMostTexts) texts_.push_back(std::move(answer));
    }
    Pump();
  }
  void OnTimer() override { Pump(); }
  void OnWritten(std::size_t bytes) override {
    ++shared_.counters.foxglove_messages;
    shared_.counters.foxglove_bytes += bytes;
    Pump();
  }

 private:
  // Writes what is first in line; with nothing there, waits.
  void Pump() {
    if (is_writing() || is_leaving()) return;
    const auto now = steady_clock::now();
    if (now - looked_at_ >= kLookEvery) {
      looked_at_ = now;
      if (!IsAllowed()) return;
    }
    SampleQueue::Waiting first;
    {
      const std::lock_guard lock(mutex_);
      if (texts_.empty() && samples_.empty()) {
        is_pumping_ = false;
        has_told_dropping_ = false;
      } else {
        is_pumping_ = true;
        if (dropped_ > 0 && !has_told_dropping_) {
          has_told_dropping_ = true;
          texts_.push_front(
              FoxgloveStatus(1, "samples are dropped: this connection is too slow for them"));
        }
        dropped_ = 0;
        if (texts_.empty()) first = samples_.Pop();
      }
    }
    if (!texts_.empty()) {
      text_ = std::move(texts_.front());
      texts_.pop_front();
      return Write(true, asio::buffer(text_));
    }
    if (first.sample == nullptr) return WakeAt(now + kLookEvery);
    sample_ = std::move(first.sample);
    PutFoxgloveHead(first.subscription, sample_->at, head_);
    Write(false,
          std::array<asio::const_buffer, 2>{asio::buffer(head_), asio::buffer(sample_->cdr)});
  }

  std::mutex mutex_;  // of the next four
  FoxgloveSubscriptions subscriptions_;
  SampleQueue samples_;
  std::size_t dropped_ = 0;
  bool is_pumping_ = true;  // a call of Pump is under way that will look again

  std::deque<std::string> texts_;
  std::string text_;
  std::shared_ptr<const Sample> sample_;
  std::array<std::byte, kFoxgloveHeadBytes> head_{};
  bool has_told_dropping_ = false;
  steady_clock::time_point looked_at_{};
};

}  // namespace

void OpenWebSocket(ServerShared& shared,
                   WireStream stream,
                   const BeastRequest& request,
                   const Upgrade& upgrade) {
  const ServerLimits& limits = shared.options.limits;
  if (upgrade.to == Upgrade::To::kLive) {
    std::make_shared<LiveSocket>(shared, std::move(stream), upgrade.identity)
        ->Open(request, "tbm.console.v1", limits.live_client_bytes);
  } else {
    std::make_shared<FoxgloveSocket>(shared, std::move(stream), upgrade.identity)
        ->Open(request, "foxglove.websocket.v1", limits.foxglove_client_bytes);
  }
}

}  // namespace tbm::hmi
