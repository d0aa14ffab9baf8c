#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "hmi_bridge/server/http_message.h"
#include "hmi_bridge/server/router.h"
#include "hmi_bridge/server/server_options.h"
#include "hmi_bridge/server/static_files.h"
#include "tests/hmi_bridge/server/fake_source.h"
#include "tests/support/fake_clock.h"
#include "tests/support/temp_folder.h"

// All that decides, without sockets: a request in, an answer out.
namespace tbm::hmi {

using Json = nlohmann::json;

inline constexpr const char* kPassword = "grease and granite";

inline std::string Header(const Response& response, std::string_view name) {
  for (const auto& [key, value] : response.headers) {
    if (key == name) return value;
  }
  return {};
}

inline std::string Body(const Response& response) { return response.body ? *response.body : ""; }

inline std::string ErrorOf(const Response& response) {
  const Json body = Json::parse(Body(response), nullptr, false);
  return body.is_object() ? body.value("error", "") : "";
}

// The page as a build leaves it.
inline void WritePage(const std::string& folder) {
  std::filesystem::create_directories(folder + "/assets");
  tbm::test::WriteText(folder + "/index.html", "<!doctype html><title>console</title>");
  tbm::test::WriteText(folder + "/assets/main-1a2b3c4d.js", std::string(5000, 'x') + "/* page */");
  tbm::test::WriteText(folder + "/assets/tiny-1a2b3c4d.css", "a{}");
  tbm::test::WriteText(folder + "/icon.png", "\x89PNG");
}

class Gate : public ::testing::Test {
 protected:
  Gate() {
    AuthLimits cheap;
    cheap.log2_n = kLeastLog2N;
    auth_ = std::move(AuthStore::Open(folder_ / "state", clock_, cheap)).value();
    for (const auto& [name, role] :
         {std::pair{"vera", Role::kViewer}, {"otto", Role::kOperator}, {"sue", Role::kSurveyor}}) {
      EXPECT_EQ(auth_->AddUser(name, role, kPassword), std::nullopt);
    }
    read_token_ = *auth_->AddToken("grafana");
    WritePage(folder_ / "web");
    files_ = std::move(StaticFiles::Read(folder_ / "web")).value();
    options_.openapi_text = "openapi: 3.1.0\n";
    options_.allowed_names = {"tbm-panel"};
    options_.on_event = [this](const ServerEvent& event) { events_.push_back(event); };
    router_ = std::make_unique<Router>(options_, files_, source_, *auth_, clock_, counters_);
  }

  static Request Get(std::string target, std::string cookie = "") {
    Request request;
    request.method = "GET";
    request.target = std::move(target);
    request.host = "127.0.0.1:8080";
    request.cookie = std::move(cookie);
    request.peer = {"127.0.0.1", "127.0.0.1", true, false};
    return request;
  }
  static Request Post(std::string target, std::string body, std::string cookie = "") {
    Request request = Get(std::move(target), std::move(cookie));
    request.method = "POST";
    request.body = std::move(body);
    request.content_type = "application/json";
    request.has_origin = true;
    request.origin = "http://127.0.0.1:8080";
    return request;
  }
  static Request LoginAs(const std::string& name, const std::string& password) {
    return Post("/api/login", Json{{"name", name}, {"password", password}}.dump());
  }
  static Request Socket(std::string target, std::string cookie, const char* protocol) {
    Request request = Get(std::move(target), std::move(cookie));
    request.is_upgrade = true;
    request.has_origin = true;
    request.origin = "http://127.0.0.1:8080";
    request.subprotocols = protocol;
    return request;
  }
  // Does at once what a worker would do later.
  Response Answer(const Request& request) {
    Routed routed = router_->Route(request);
    if (auto* later = std::get_if<Later>(&routed)) return later->make();
    if (auto* response = std::get_if<Response>(&routed)) return *response;
    Response opened;
    opened.status = 101;
    return opened;
  }
  // "tbm_session=..."
  std::string CookieOf(const std::string& name) {
    const std::string header = Header(Answer(LoginAs(name, kPassword)), "Set-Cookie");
    return header.substr(0, header.find(';'));
  }

  tbm::test::TempFolder folder_;
  tbm::test::FakeClock clock_;
  std::unique_ptr<AuthStore> auth_;
  std::string read_token_;
  StaticFiles files_;
  ServerOptions options_;
  test::FakeSource source_;
  Counters counters_;
  std::vector<ServerEvent> events_;
  std::unique_ptr<Router> router_;
};

}  // namespace tbm::hmi
