#include "hmi_bridge/server/console_server.h"

#include <atomic>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <thread>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/v6_only.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <fmt/format.h>
#include <openssl/ssl.h>

#include "hmi_bridge/server/http_connection.h"
#include "hmi_bridge/server/server_core.h"
#include "hmi_bridge/server/wire_stream.h"

namespace tbm::hmi {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

constexpr int kThreads = 2;
// No file descriptor left, say: nothing is gained by trying at once.
constexpr std::chrono::milliseconds kAcceptAgain(200);
constexpr std::chrono::seconds kHousekeeping(10);

std::string TextOf(const ListenAddress& listen) {
  const bool is_v6 = listen.address.find(':') != std::string::npos;
  const std::string host = is_v6 ? "[" + listen.address + "]" : listen.address;
  return fmt::format("{}:{}", host, listen.port);
}

std::string PlainAddress(asio::ip::address address) {
  if (address.is_v6() && address.to_v6().is_v4_mapped()) {
    address = asio::ip::make_address_v4(asio::ip::v4_mapped, address.to_v6());
  }
  if (address.is_v6()) {
    // Without the interface of a link's address: nobody else names it so.
    return asio::ip::address_v6(address.to_v6().to_bytes()).to_string();
  }
  return address.to_string();
}

// TLS 1.2 with forward secrecy and authenticated ciphers, or TLS 1.3.
std::unique_ptr<asio::ssl::context> TlsContext(const TlsFiles& files) {
  auto context = std::make_unique<asio::ssl::context>(asio::ssl::context::tls_server);
  SSL_CTX* raw = context->native_handle();
  SSL_CTX_set_min_proto_version(raw, TLS1_2_VERSION);
  SSL_CTX_set_options(raw,
                      SSL_OP_NO_RENEGOTIATION | SSL_OP_CIPHER_SERVER_PREFERENCE |
                          SSL_OP_NO_COMPRESSION | SSL_OP_NO_TICKET);
  SSL_CTX_set_cipher_list(raw, "ECDHE+AESGCM:ECDHE+CHACHA20");
  error_code error;
  context->use_certificate_chain_file(files.certificate_pem, error);
  if (!error) context->use_private_key_file(files.key_pem, asio::ssl::context::pem, error);
  if (error) return nullptr;
  return context;
}

}  // namespace

struct ConsoleServer::Core {
  Core(ServerOptions options,
       ConsoleSource& source,
       RawSource& raw,
       AuthStore& auth,
       const Clock& clock)
      : shared(std::move(options), source, raw, auth, clock) {}

  std::vector<std::string> Open();
  std::string WhyNotListen(const ListenAddress& listen);
  void Accept(tcp::acceptor& acceptor);
  void OnAccepted(tcp::acceptor& acceptor, error_code error, tcp::socket socket);
  void Serve(tcp::socket socket);
  void KeepHouse();
  void TellAccept(const error_code& error);

  ServerShared shared;
  std::unique_ptr<asio::ssl::context> tls;
  std::atomic<bool> is_notified{false};
  std::atomic<bool> has_told_accept{false};  // once, until one succeeds
  std::shared_mutex running;                 // held by those who use the context from outside
  bool is_running = false;
  // Its connections go with it, while all above still is.
  std::unique_ptr<asio::io_context> context = std::make_unique<asio::io_context>(kThreads);
  std::unique_ptr<asio::steady_timer> housekeeping;
  std::vector<std::unique_ptr<tcp::acceptor>> acceptors;
  std::vector<std::uint16_t> ports;
  std::vector<std::thread> threads;
};

std::string ConsoleServer::Core::WhyNotListen(const ListenAddress& listen) {
  const tcp::endpoint endpoint(asio::ip::make_address(listen.address), listen.port);
  auto acceptor = std::make_unique<tcp::acceptor>(asio::make_strand(*context));
  error_code error;
  acceptor->open(endpoint.protocol(), error);
  if (!error && endpoint.address().is_v6()) {
    acceptor->set_option(asio::ip::v6_only(true), error);
  }
  if (!error) acceptor->set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor->bind(endpoint, error);
  if (!error) acceptor->listen(asio::socket_base::max_listen_connections, error);
  const std::uint16_t port = error ? std::uint16_t{0} : acceptor->local_endpoint(error).port();
  if (!error) {
    acceptors.push_back(std::move(acceptor));
    ports.push_back(port);
    return {};
  }
  if (error == asio::error::address_in_use) {
    return fmt::format("{}: another program listens there already (a bridge that still runs?)",
                       TextOf(listen));
  }
  if (error == asio::error::access_denied) {
    return fmt::format("{}: not permitted; ports below 1024 are root's", TextOf(listen));
  }
  return fmt::format("{}: cannot listen: {}", TextOf(listen), error.message());
}

std::vector<std::string> ConsoleServer::Core::Open() {
  std::vector<std::string> problems = Problems(shared.options);
  if (!problems.empty()) return problems;
  if (shared.options.tls) {
    tls = TlsContext(*shared.options.tls);
    if (tls == nullptr) {
      problems.push_back(fmt::format("certificate {} with key {}: OpenSSL does not take them",
                                     shared.options.tls->certificate_pem,
                                     shared.options.tls->key_pem));
    }
  }
  if (!shared.options.web_folder.empty()) {
    auto files = StaticFiles::Read(shared.options.web_folder);
    if (!files) return {files.error()};
    shared.files = std::move(files).value();
  }
  for (const ListenAddress& listen : shared.options.listen) {
    std::string why_not = WhyNotListen(listen);
    if (!why_not.empty()) problems.push_back(std::move(why_not));
  }
  if (!problems.empty()) acceptors.clear();
  return problems;
}

void ConsoleServer::Core::Accept(tcp::acceptor& acceptor) {
  acceptor.async_accept(asio::make_strand(*context),
                        [this, &acceptor](error_code error, tcp::socket socket) {
                          OnAccepted(acceptor, error, std::move(socket));
                        });
}

void ConsoleServer::Core::OnAccepted(tcp::acceptor& acceptor,
                                     error_code error,
                                     tcp::socket socket) {
  if (error == asio::error::operation_aborted) return;
  if (!error) {
    has_told_accept = false;
    Serve(std::move(socket));
    return Accept(acceptor);
  }
  if (!has_told_accept.exchange(true)) TellAccept(error);
  auto again = std::make_shared<asio::steady_timer>(acceptor.get_executor(), kAcceptAgain);
  again->async_wait([this, &acceptor, again](error_code aborted) {
    if (!aborted) Accept(acceptor);
  });
}

void ConsoleServer::Core::TellAccept(const error_code& error) {
  if (!shared.options.on_event) return;
  shared.options.on_event({ServerEvent::What::kAcceptFault, "", "", error.message()});
}

void ConsoleServer::Core::Serve(tcp::socket socket) {
  error_code error;
  const tcp::endpoint there = socket.remote_endpoint(error);
  if (error) return;
  const tcp::endpoint here = socket.local_endpoint(error);
  if (error) return;
  Peer peer{PlainAddress(there.address()),
            PlainAddress(here.address()),
            there.address().is_loopback(),
            tls != nullptr};
  auto place = shared.Admit(peer.address, peer.is_loopback);
  if (place == nullptr) return;
  socket.set_option(tcp::no_delay(true), error);
  // On its own strand from the first step: the acceptor's is another one.
  const auto strand = socket.get_executor();
  auto stream = std::make_shared<WireStream>(std::move(socket), tls.get(), std::move(place));
  asio::post(strand, [this, stream, peer] { ServeHttp(shared, std::move(*stream), peer); });
}

void ConsoleServer::Core::KeepHouse() {
  housekeeping->expires_after(kHousekeeping);
  housekeeping->async_wait([this](error_code error) {
    if (error) return;
    shared.writing.Post([this] {
      std::vector<std::string> faults = shared.auth.TakeFaults();
      if (auto fault = shared.auth.KeepUses()) faults.push_back(std::move(*fault));
      for (const std::string& fault : faults) {
        if (!shared.options.on_event) break;
        shared.options.on_event({ServerEvent::What::kStateFault, "", "", fault});
      }
    });
    KeepHouse();
  });
}

ConsoleServer::ConsoleServer(ServerOptions options,
                             ConsoleSource& source,
                             RawSource& raw,
                             AuthStore& auth,
                             const Clock& clock)
    : core_(std::make_unique<Core>(std::move(options), source, raw, auth, clock)) {}

ConsoleServer::~ConsoleServer() { Stop(); }

std::vector<std::string> ConsoleServer::Start() {
  std::vector<std::string> problems = core_->Open();
  if (!problems.empty()) return problems;
  core_->shared.hashing.Start();
  core_->shared.writing.Start();
  for (auto& acceptor : core_->acceptors) core_->Accept(*acceptor);
  core_->housekeeping = std::make_unique<asio::steady_timer>(*core_->context);
  core_->KeepHouse();
  for (int i = 0; i < kThreads; ++i) {
    core_->threads.emplace_back([this] { core_->context->run(); });
  }
  const std::lock_guard lock(core_->running);
  core_->is_running = true;
  return {};
}

void ConsoleServer::Stop() {
  {
    const std::lock_guard lock(core_->running);
    core_->is_running = false;
  }
  if (core_->context == nullptr) return;
  core_->context->stop();
  for (std::thread& thread : core_->threads) thread.join();
  core_->threads.clear();
  core_->shared.hashing.Stop();
  core_->shared.writing.Stop();
  core_->acceptors.clear();
  core_->housekeeping.reset();
  core_->context.reset();
}

std::uint16_t ConsoleServer::port(std::size_t index) const { return core_->ports.at(index); }

void ConsoleServer::Notify() {
  const std::shared_lock lock(core_->running);
  if (!core_->is_running || core_->is_notified.exchange(true)) return;
  asio::post(*core_->context, [core = core_.get()] {
    core->is_notified = false;
    for (const auto& socket : core->shared.Sockets()) socket->Poke();
  });
}

bool ConsoleServer::HasListener(std::size_t channel) const {
  const auto& listeners = core_->shared.listeners;
  return channel < listeners.size() && listeners[channel] > 0;
}

void ConsoleServer::Publish(std::size_t channel, Timestamp at, std::span<const std::byte> cdr) {
  if (!HasListener(channel)) return;
  const std::shared_lock lock(core_->running);
  if (!core_->is_running) return;
  const auto sample = std::make_shared<const Sample>(Sample{channel, at, {cdr.begin(), cdr.end()}});
  for (const auto& socket : core_->shared.Sockets()) socket->Offer(sample);
}

std::string ConsoleServer::Metrics() const { return core_->shared.counters.Text(); }

}  // namespace tbm::hmi
