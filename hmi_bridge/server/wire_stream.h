#pragma once

#include <memory>
#include <optional>
#include <utility>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/beast/core/bind_handler.hpp>
#include <boost/beast/core/role.hpp>

namespace tbm::hmi {

// A connection, with or without TLS: one type for what reads and writes, so that HTTP and WebSocket
// are compiled once. Boost.Beast takes it for an AsyncStream.
class WireStream {
 public:
  using Socket = boost::asio::ip::tcp::socket;
  using executor_type = Socket::executor_type;

  // `place` is held for as long as the connection is. Without `tls` it is plain.
  WireStream(Socket socket, boost::asio::ssl::context* tls, std::shared_ptr<void> place)
      : held_(std::make_unique<Held>(std::move(socket), std::move(place))) {
    if (tls != nullptr) held_->tls.emplace(held_->socket, *tls);
  }

  executor_type get_executor() { return held_->socket.get_executor(); }
  Socket& socket() { return held_->socket; }
  bool is_tls() const { return held_->tls.has_value(); }

  template <class Handler>
  void async_handshake(Handler&& handler) {
    held_->tls->async_handshake(boost::asio::ssl::stream_base::server,
                                std::forward<Handler>(handler));
  }

  template <class Buffers, class Handler>
  auto async_read_some(const Buffers& buffers, Handler&& handler) {
    if (held_->tls) return held_->tls->async_read_some(buffers, std::forward<Handler>(handler));
    return held_->socket.async_read_some(buffers, std::forward<Handler>(handler));
  }

  template <class Buffers, class Handler>
  auto async_write_some(const Buffers& buffers, Handler&& handler) {
    if (held_->tls) return held_->tls->async_write_some(buffers, std::forward<Handler>(handler));
    return held_->socket.async_write_some(buffers, std::forward<Handler>(handler));
  }

  // At once, without waiting for the other end.
  void Close() {
    boost::system::error_code ignored;
    held_->socket.close(ignored);
  }

 private:
  struct Held {
    Held(Socket its_socket, std::shared_ptr<void> its_place)
        : place(std::move(its_place)), socket(std::move(its_socket)) {}

    std::shared_ptr<void> place;
    Socket socket;
    std::optional<boost::asio::ssl::stream<Socket&>> tls;
  };

  std::unique_ptr<Held> held_;
};

// Boost.Beast's points of adaptation. The closing handshake of WebSocket was made before: that of
// TLS would only be one more thing to wait for.
inline void beast_close_socket(WireStream& stream) { stream.Close(); }

inline void teardown(boost::beast::role_type,
                     WireStream& stream,
                     boost::system::error_code& error) {
  stream.Close();
  error = {};
}

template <class Handler>
void async_teardown(boost::beast::role_type, WireStream& stream, Handler&& handler) {
  boost::system::error_code ignored;
  stream.socket().shutdown(WireStream::Socket::shutdown_both, ignored);
  boost::asio::post(stream.get_executor(),
                    boost::beast::bind_front_handler(std::forward<Handler>(handler),
                                                     boost::system::error_code{}));
}

}  // namespace tbm::hmi
