#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "hmi_bridge/server/auth_store.h"
#include "hmi_bridge/server/console_server.h"
#include "pose/base/clock.h"
#include "tests/hmi_bridge/server/fake_source.h"
#include "tests/hmi_bridge/server/wire_client.h"
#include "tests/support/temp_folder.h"

namespace tbm::hmi::test {

inline constexpr const char* kPassword = "grease and granite";

// A server on a port that the system chooses, and its users vera, otto and sue.
class ServerTest : public ::testing::Test {
 protected:
  ServerTest() {
    limits_.log2_n = kLeastLog2N;
    OpenStore();
    for (const auto& [name, role] :
         {std::pair{"vera", Role::kViewer}, {"otto", Role::kOperator}, {"sue", Role::kSurveyor}}) {
      EXPECT_EQ(auth_->AddUser(name, role, kPassword), std::nullopt);
    }
    read_token_ = *auth_->AddToken("tool");
    options_.openapi_text = "openapi: 3.1.0\n";
    // Many log in from here in a short time.
    options_.limits.logins_at_once = 1000;
    options_.on_event = [this](const ServerEvent& event) {
      const std::lock_guard lock(mutex_);
      events_.push_back(event);
    };
  }
  void OpenStore() {
    auto opened = AuthStore::Open(folder_ / "state", clock_, limits_);
    ASSERT_TRUE(opened) << opened.error();
    auth_ = std::move(opened).value();
  }
  void Start() {
    server_ = std::make_unique<ConsoleServer>(options_, source_, raw_, *auth_, clock_);
    ASSERT_EQ(server_->Start(), std::vector<std::string>());
    port_ = server_->port();
  }
  std::string Host() const { return "127.0.0.1:" + std::to_string(port_); }
  // Lines that every honest request has.
  std::string Lines(const std::string& cookie = "") const {
    return "Host: " + Host() + "\r\n" + (cookie.empty() ? "" : "Cookie: " + cookie + "\r\n");
  }
  std::string Own() const {
    return std::string("Origin: ") + (options_.tls ? "https://" : "http://") + Host() + "\r\n";
  }
  std::string Get(const std::string& path, const std::string& more = "") const {
    return "GET " + path + " HTTP/1.1\r\n" + Lines() + more + "\r\n";
  }
  std::string Post(const std::string& path,
                   const std::string& body,
                   const std::string& cookie) const {
    return "POST " + path + " HTTP/1.1\r\n" + Lines(cookie) + Own() +
           "Content-Type: application/json\r\nContent-Length: " + std::to_string(body.size()) +
           "\r\n\r\n" + body;
  }
  std::string LoginBody(const std::string& name, const std::string& password) const {
    return R"({"name":")" + name + R"(","password":")" + password + "\"}";
  }
  // "tbm_session=..."
  std::string CookieOf(const std::string& name, WireClient::Tls tls = WireClient::Tls::kNone) {
    WireClient client(port_, tls);
    const auto answer = client.Ask(Post("/api/login", LoginBody(name, kPassword), ""));
    EXPECT_EQ(answer.status, 200) << answer.body;
    const auto set = answer.headers.find("set-cookie");
    return set == answer.headers.end() ? "" : set->second.substr(0, set->second.find(';'));
  }
  // The value of a line of the metrics; -1 without.
  double Metric(const std::string& name) const {
    const std::string text = "\n" + server_->Metrics();
    const std::size_t at = text.find("\n" + name + " ");
    return at == std::string::npos ? -1.0 : std::stod(text.substr(at + name.size() + 2));
  }
  // Waits for it: counters follow the wire by a moment.
  bool Reaches(const std::string& name, double value) const {
    for (int i = 0; i < 1000; ++i) {
      if (Metric(name) == value) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
  }

  tbm::test::TempFolder folder_;
  SystemClock clock_;
  AuthLimits limits_;
  std::unique_ptr<AuthStore> auth_;
  std::string read_token_;
  FakeSource source_;
  FakeRaw raw_;
  ServerOptions options_;
  std::mutex mutex_;
  std::vector<ServerEvent> events_;
  std::unique_ptr<ConsoleServer> server_;
  std::uint16_t port_ = 0;
};

}  // namespace tbm::hmi::test
