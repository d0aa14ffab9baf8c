#include "hmi_bridge/server/http_connection.h"

#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/read.hpp>

#include "hmi_bridge/server/http_parse.h"
#include "hmi_bridge/server/web_sockets.h"

namespace tbm::hmi {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using boost::system::error_code;

// After the last answer: what still comes is read for so long, or the reset that follows unread
// bytes would overtake the answer.
constexpr std::chrono::milliseconds kLinger(1000);
constexpr std::size_t kMostLingered = 256 * 1024;

// All of it runs on the connection's strand.
class HttpConnection : public std::enable_shared_from_this<HttpConnection> {
 public:
  HttpConnection(ServerShared& shared, WireStream stream, Peer peer)
      : shared_(shared),
        stream_(std::move(stream)),
        timer_(stream_.get_executor()),
        peer_(std::move(peer)),
        buffer_(shared.options.limits.header_bytes + shared.options.limits.body_bytes + 4096) {}

  void Start() {
    CloseAfter(limits().request);
    if (!stream_.is_tls()) return AwaitRequest(limits().request);
    stream_.async_handshake([self = shared_from_this()](error_code error) {
      if (error) {
        self->shared_.counters.Refuse(Refusal::kTls);
        return self->Close();
      }
      self->AwaitRequest(self->limits().request);
    });
  }

 private:
  const ServerLimits& limits() const { return shared_.options.limits; }

  void CloseAfter(std::chrono::milliseconds span) {
    timer_.expires_after(span);
    timer_.async_wait([self = shared_from_this(), round = ++timer_round_](error_code error) {
      // One that had expired already cannot be called back: it is told by its number.
      if (error || round != self->timer_round_) return;
      if (!self->is_lingering_ && !self->is_idle_) {
        self->shared_.counters.Refuse(Refusal::kTimeout);
      }
      self->Close();
    });
  }

  void StopTimer() {
    ++timer_round_;
    timer_.cancel();
  }

  void Close() {
    StopTimer();
    stream_.Close();
  }

  // Until the first byte comes; from then on a request has to get on.
  void AwaitRequest(std::chrono::milliseconds patience) {
    parser_.emplace();
    Limit(*parser_, limits());
    if (buffer_.size() > 0) return ReadRequest();
    CloseAfter(patience);
    stream_.async_read_some(buffer_.prepare(4096),
                            [self = shared_from_this()](error_code error, std::size_t bytes) {
                              if (error) return self->Close();
                              self->is_idle_ = false;
                              self->buffer_.commit(bytes);
                              self->ReadRequest();
                            });
  }

  void ReadRequest() {
    CloseAfter(limits().request);
    http::async_read_header(
        stream_, buffer_, *parser_, [self = shared_from_this()](error_code error, std::size_t) {
          if (error) return self->OnUnreadable(error);
          self->OnHead();
        });
  }

  // Before anything of a body is read: how long it says it is, and whether that is welcome.
  void OnHead() {
    const Request head = RequestFrom(parser_->get(), peer_);
    if (head.has_transfer_encoding) return OnRequest();  // refused there, unread
    if (parser_->content_length().value_or(0) > shared_.router.BodyLimit(head)) {
      return OnUnreadable(http::error::body_limit);
    }
    http::async_read(
        stream_, buffer_, *parser_, [self = shared_from_this()](error_code error, std::size_t) {
          if (error) return self->OnUnreadable(error);
          self->OnRequest();
        });
  }

  void OnUnreadable(const error_code& error) {
    if (error == http::error::end_of_stream ||
        error.category() == asio::error::get_system_category() ||
        error.category() == asio::error::get_ssl_category() ||
        error == asio::ssl::error::stream_truncated) {
      return Close();
    }
    shared_.counters.Refuse(Refusal::kMalformed);
    Response response = ErrorResponse(StatusOf(error), "bad_request", error.message());
    response.must_close = true;
    Send(std::move(response));
  }

  void OnRequest() {
    const Request request = RequestFrom(parser_->get(), peer_);
    is_head_ = request.method == "HEAD";
    keeps_alive_ = request.is_keep_alive;
    Routed routed = shared_.router.Route(request);
    if (auto* response = std::get_if<Response>(&routed)) return Send(std::move(*response));
    if (auto* later = std::get_if<Later>(&routed)) return AnswerLater(std::move(*later));
    // A client that speaks before it was answered has mistaken us for something else.
    if (buffer_.size() > 0) return Close();
    StopTimer();
    OpenWebSocket(shared_, std::move(stream_), parser_->get(), std::get<Upgrade>(routed));
  }

  void AnswerLater(Later later) {
    StopTimer();
    Worker& worker = later.where == Later::Where::kHashing ? shared_.hashing : shared_.writing;
    const bool is_taken = worker.Post([self = shared_from_this(), make = std::move(later.make)] {
      auto response = std::make_shared<Response>(make());
      asio::post(self->stream_.get_executor(),
                 [self, response] { self->Send(std::move(*response)); });
    });
    if (!is_taken) Send(shared_.router.Busy());
  }

  void Send(Response response) {
    keeps_alive_ = keeps_alive_ && !response.must_close;
    head_ = ResponseHead(response, stream_.is_tls(), keeps_alive_);
    body_ = is_head_ ? nullptr : response.body;
    CloseAfter(limits().answer);
    const std::array<asio::const_buffer, 2> parts = {
        asio::buffer(head_), body_ ? asio::buffer(*body_) : asio::const_buffer()};
    asio::async_write(stream_, parts, [self = shared_from_this()](error_code error, std::size_t) {
      self->body_.reset();
      if (error) return self->Close();
      if (!self->keeps_alive_) return self->Linger();
      self->is_idle_ = true;
      self->AwaitRequest(self->limits().idle);
    });
  }

  void Linger() {
    is_lingering_ = true;
    CloseAfter(kLinger);
    error_code ignored;
    stream_.socket().shutdown(WireStream::Socket::shutdown_send, ignored);
    ReadAway();
  }

  void ReadAway() {
    stream_.socket().async_read_some(
        asio::buffer(away_), [self = shared_from_this()](error_code error, std::size_t bytes) {
          self->lingered_ += bytes;
          if (error || self->lingered_ > kMostLingered) return self->Close();
          self->ReadAway();
        });
  }

  ServerShared& shared_;
  WireStream stream_;
  asio::steady_timer timer_;
  unsigned timer_round_ = 0;
  const Peer peer_;
  beast::flat_buffer buffer_;
  std::optional<BeastParser> parser_;
  std::string head_;
  std::shared_ptr<const std::string> body_;
  std::array<char, 4096> away_{};
  std::size_t lingered_ = 0;
  bool is_head_ = false;
  bool keeps_alive_ = false;
  bool is_idle_ = false;  // between requests: nobody is slow
  bool is_lingering_ = false;
};

}  // namespace

void ServeHttp(ServerShared& shared, WireStream stream, const Peer& peer) {
  std::make_shared<HttpConnection>(shared, std::move(stream), peer)->Start();
}

}  // namespace tbm::hmi
