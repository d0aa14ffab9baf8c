#include <chrono>
#include <cstring>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "hmi_bridge/server/tls_files.h"
#include "tests/hmi_bridge/server/server_fixture.h"

namespace tbm::hmi {
namespace {

using test::Frame;
using test::HttpAnswer;
using test::kPassword;
using test::WireClient;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using namespace std::chrono_literals;
using Json = nlohmann::json;

class Server : public test::ServerTest {
 protected:
  HttpAnswer OpenLive(WireClient& client, const std::string& cookie) {
    return client.Open("/api/live", "tbm.console.v1", Lines(cookie) + Own());
  }
  static Json NextText(WireClient& client) {
    const auto frame = client.Read();
    if (!frame || frame->opcode != 1) return {};
    return Json::parse(frame->payload, nullptr, false);
  }
};

TEST_F(Server, ServesThePageAndKeepsTheConnection) {
  std::filesystem::create_directories(folder_ / "web/assets");
  tbm::test::WriteText(folder_ / "web/index.html", "<!doctype html>");
  options_.web_folder = folder_ / "web";
  Start();
  std::filesystem::remove_all(folder_ / "web");  // it is in memory
  WireClient client(port_);
  for (int i = 0; i < 3; ++i) {
    const HttpAnswer page = client.Ask(Get("/"));
    EXPECT_EQ(page.status, 200);
    EXPECT_EQ(page.body, "<!doctype html>");
    EXPECT_EQ(page.headers.at("connection"), "keep-alive");
    EXPECT_THAT(page.headers.at("content-security-policy"), HasSubstr("default-src 'none'"));
  }
  client.Send("HEAD / HTTP/1.1\r\n" + Lines() + "\r\n");
  const HttpAnswer head = client.Answer(true);
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.headers.at("content-length"), "15");
  EXPECT_EQ(client.Ask(Get("/nothing")).status, 404) << "nothing of a body came in between";
  // Two requests at once are answered in turn.
  client.Send(Get("/healthz") + Get("/api/openapi.yaml"));
  EXPECT_EQ(client.Answer().body, "ok");
  EXPECT_EQ(client.Answer().body, options_.openapi_text);
  EXPECT_EQ(client.Ask("GET /healthz HTTP/1.0\r\n" + Lines() + "\r\n").status, 200);
  EXPECT_TRUE(client.IsClosedWithin(5s));
}

TEST_F(Server, LoggingInAndOutOverTheWire) {
  Start();
  WireClient client(port_);
  EXPECT_EQ(client.Ask(Post("/api/login", LoginBody("otto", "wrong password"), "")).status, 401);
  const std::string cookie = CookieOf("otto");
  const HttpAnswer me = client.Ask(Get("/api/me", "Cookie: " + cookie + "\r\n"));
  EXPECT_EQ(Json::parse(me.body)["role"], "operator");
  std::string forged = cookie;
  forged.back() = static_cast<char>(forged.back() ^ 1);
  EXPECT_EQ(client.Ask(Get("/api/me", "Cookie: " + forged + "\r\n")).status, 401);
  const HttpAnswer sent =
      client.Ask(Post("/api/commands", R"({"addressee":"guidance","verb":"acknowledge"})", cookie));
  EXPECT_EQ(sent.status, 202);
  EXPECT_EQ(client.Ask(Post("/api/logout", "", cookie)).status, 204);
  EXPECT_EQ(client.Ask(Get("/api/me", "Cookie: " + cookie + "\r\n")).status, 401);
  const std::lock_guard lock(mutex_);
  ASSERT_EQ(events_.size(), 3u);
  EXPECT_EQ(events_[0].what, ServerEvent::What::kLoginWrong);
  EXPECT_EQ(events_[0].address, "127.0.0.1");
  EXPECT_EQ(events_[2].what, ServerEvent::What::kLoggedOut);
}

TEST_F(Server, SessionsOutliveTheBridge) {
  Start();
  const std::string cookie = CookieOf("vera");
  server_.reset();
  OpenStore();
  Start();
  WireClient client(port_);
  EXPECT_EQ(client.Ask(Get("/api/me", "Cookie: " + cookie + "\r\n")).status, 200);
}

TEST_F(Server, WhatIsNoHttpIsRefusedAndHarmsNobody) {
  Start();
  WireClient honest(port_);
  const std::string host = Lines();
  const std::string body(20'000, 'x');
  struct Bad {
    std::string bytes;
    int status;
  };
  const std::vector<Bad> cases = {
      {"\r\n\r\n\x01\x02\x03", 400},
      {"GET /healthz\r\n\r\n", 400},
      {"GET /healthz HTTP/9.9\r\n" + host + "\r\n", 400},
      {"GET /heal thz HTTP/1.1\r\n" + host + "\r\n", 400},
      {"G\xc3\xa4T / HTTP/1.1\r\n" + host + "\r\n", 400},
      {"GET /healthz HTTP/1.1\nHost: localhost\n\n", 400},
      {"GET /healthz HTTP/1.1\r\nHost : localhost\r\n\r\n", 400},
      {"GET /healthz HTTP/1.1\r\n" + host + "X: a\rb\r\n\r\n", 400},
      {std::string("GET /healthz HTTP/1.1\r\n") + host + std::string("X: a\0b\r\n\r\n", 10), 400},
      {"GET /healthz HTTP/1.1\r\n\r\n", 421},
      {"GET /healthz HTTP/1.1\r\n" + host + "Host: evil.example\r\n\r\n", 421},
      {"GET /healthz HTTP/1.1\r\nHost: evil.example\r\n\r\n", 421},
      {"GET /healthz HTTP/1.1\r\n" + host + "X: " + std::string(9000, 'a') + "\r\n\r\n", 431},
      {"GET /" + std::string(9000, 'a') + " HTTP/1.1\r\n" + host + "\r\n", 431},
      {"POST /api/login HTTP/1.1\r\n" + host + "Content-Length: 20000\r\n\r\n" + body, 413},
      {"POST /api/login HTTP/1.1\r\n" + host + "Content-Length: 99999999999999999999\r\n\r\n", 400},
      {"POST /api/login HTTP/1.1\r\n" + host + "Content-Length: -1\r\n\r\n", 400},
      {"POST /api/login HTTP/1.1\r\n" + host + "Content-Length: 1, 2\r\n\r\nxx", 400},
      // Smuggling: two opinions on where a request ends.
      {"POST /api/login HTTP/1.1\r\n" + host +
           "Content-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n" + Get("/healthz"),
       400},
      {"POST /api/login HTTP/1.1\r\n" + host +
           "Transfer-Encoding: chunked\r\nContent-Length: 5\r\n\r\n0\r\n\r\n" + Get("/healthz"),
       400},
      {"POST /api/login HTTP/1.1\r\n" + host +
           "Content-Length: 4\r\nContent-Length: 40\r\n\r\nabcd" + Get("/healthz"),
       400},
      {"POST /api/login HTTP/1.1\r\n" + host + "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 400},
      {"POST /api/login HTTP/1.1\r\n" + host + "Transfer-Encoding: xchunked\r\n\r\nabcd", 400},
      {"GET http://evil.example/healthz HTTP/1.1\r\n" + host + "\r\n", 404},
      {"CONNECT evil.example:443 HTTP/1.1\r\n" + host + "\r\n", 404},
      {"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", 400},
  };
  for (const Bad& bad : cases) {
    WireClient client(port_);
    client.Send(bad.bytes);
    const HttpAnswer answer = client.Answer();
    EXPECT_EQ(answer.status, bad.status) << bad.bytes.substr(0, 120) << answer.body;
    if (bad.status == 404) continue;
    EXPECT_EQ(answer.headers.count("connection") != 0 ? answer.headers.at("connection") : "",
              "close")
        << bad.bytes.substr(0, 120);
    EXPECT_EQ(client.Answer().status, 0) << "no second answer: " << bad.bytes.substr(0, 120);
  }
  EXPECT_EQ(honest.Ask(Get("/healthz")).status, 200);
}

TEST_F(Server, LargeBodiesAreTakenFromWhoIsLoggedInOnly) {
  Start();
  const std::string shots =
      R"({"kind":"accuracy","shots_text":")" + std::string(200'000, 'x') + "\"}";
  WireClient stranger(port_);
  // Refused by what it says, before any of it has come.
  stranger.Send("POST /api/reports HTTP/1.1\r\n" + Lines() + "Content-Length: 200000\r\n\r\n");
  EXPECT_EQ(stranger.Answer().status, 413);
  WireClient surveyor(port_);
  const HttpAnswer answer = surveyor.Ask(Post("/api/reports", shots, CookieOf("sue")));
  EXPECT_EQ(answer.status, 202) << answer.body;
  EXPECT_EQ(surveyor.Ask(Post("/api/commands", shots, CookieOf("sue"))).status, 413);
}

TEST_F(Server, TheSlowAreLetGo) {
  options_.limits.request = 200ms;
  options_.limits.idle = 300ms;
  Start();
  WireClient silent(port_);
  WireClient slow(port_);
  WireClient dripping(port_);
  WireClient done(port_);
  slow.Send("GET /healthz HTTP/1.1\r\nHost: ");
  EXPECT_EQ(done.Ask(Get("/healthz")).status, 200);
  bool is_cut = false;
  // A byte now and then buys no time.
  for (int i = 0; i < 500 && !is_cut; ++i) {
    is_cut = !dripping.Send("G") || dripping.IsClosedWithin(20ms);
  }
  EXPECT_TRUE(is_cut);
  EXPECT_TRUE(silent.IsClosedWithin(10s));
  EXPECT_TRUE(slow.IsClosedWithin(10s));
  EXPECT_TRUE(done.IsClosedWithin(10s));
  EXPECT_TRUE(Reaches("tbm_hmi_refused_total{reason=\"timeout\"}", 3)) << server_->Metrics();
  EXPECT_TRUE(Reaches("tbm_hmi_connections", 0));
}

TEST_F(Server, TooManyConnectionsAreClosedAtOnce) {
  options_.limits.connections = 3;
  Start();
  std::vector<std::unique_ptr<WireClient>> clients;
  for (int i = 0; i < 3; ++i) {
    clients.push_back(std::make_unique<WireClient>(port_));
    EXPECT_EQ(clients.back()->Ask(Get("/healthz")).status, 200);
  }
  WireClient one_more(port_);
  EXPECT_TRUE(one_more.IsClosedWithin(10s));
  EXPECT_TRUE(Reaches("tbm_hmi_refused_total{reason=\"too_many_connections\"}", 1));
  clients.pop_back();
  EXPECT_TRUE(Reaches("tbm_hmi_connections", 2));
  WireClient again(port_);
  EXPECT_EQ(again.Ask(Get("/healthz")).status, 200);
}

TEST_F(Server, LiveSendsAllThenWhatChanges) {
  options_.limits.heartbeat = 300ms;
  Start();
  WireClient client(port_);
  const HttpAnswer answer = OpenLive(client, CookieOf("vera"));
  ASSERT_EQ(answer.status, 101);
  EXPECT_EQ(answer.headers.at("sec-websocket-protocol"), "tbm.console.v1");
  EXPECT_EQ(answer.headers.at("sec-websocket-accept"), "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=");
  EXPECT_EQ(answer.headers.count("sec-websocket-extensions"), 0u);
  EXPECT_THAT(answer.headers.at("content-security-policy"), HasSubstr("default-src 'none'"));
  Json message = NextText(client);
  EXPECT_EQ(message["number"], 1);
  EXPECT_EQ(message["sections"], Json::parse(R"({"bridge":{"version":"1"},"guidance":null})"));
  message = NextText(client);
  EXPECT_EQ(message["number"], 2) << "a heartbeat";
  EXPECT_EQ(message["sections"], Json::object());
  source_.Put("alarms", R"({"list":[]})");
  server_->Notify();
  do message = NextText(client);
  while (message["sections"] == Json::object());
  EXPECT_EQ(message["sections"], Json::parse(R"({"alarms":{"list":[]}})"));
  // Of what changes faster than ten times a second the newest comes.
  for (int i = 1; i <= 200; ++i) {
    source_.Put("guidance", std::to_string(i));
    server_->Notify();
  }
  int messages = 0;
  do {
    message = NextText(client);
    ++messages;
  } while (message.is_object() && message["sections"].value("guidance", 0) != 200);
  EXPECT_LE(messages, 4);
  EXPECT_EQ(message["sections"]["guidance"], 200);
}

TEST_F(Server, LiveNeedsAnHonestOpening) {
  Start();
  const std::string cookie = CookieOf("vera");
  const auto status = [&](const std::string& headers) {
    WireClient client(port_);
    return client.Open("/api/live", "tbm.console.v1", headers).status;
  };
  EXPECT_EQ(status(Lines() + Own()), 401);
  EXPECT_EQ(status(Lines(cookie)), 403);
  EXPECT_EQ(status(Lines(cookie) + "Origin: http://evil.example\r\n"), 403);
  EXPECT_EQ(status(Lines(cookie) + Own() + "Origin: http://evil.example\r\n"), 403);
  EXPECT_EQ(
      status("Host: evil.example\r\nCookie: " + cookie + "\r\nOrigin: http://evil.example\r\n"),
      421);
  EXPECT_EQ(status(Lines() + "Authorization: Bearer " + read_token_ + "\r\n"), 101);
  WireClient hasty(port_);
  hasty.Send(
      "GET /api/live HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
      "Sec-WebSocket-Protocol: tbm.console.v1\r\n" +
      Lines(cookie) + Own() + "\r\n" + Get("/healthz"));
  EXPECT_EQ(hasty.Answer().status, 0) << "who speaks before the answer is let go";
}

TEST_F(Server, WhatAConsoleSaysIsReadAndNotTooMuchOfIt) {
  options_.limits.heartbeat = 50ms;
  Start();
  const std::string cookie = CookieOf("vera");
  WireClient client(port_);
  ASSERT_EQ(OpenLive(client, cookie).status, 101);
  client.SendFrame(1, R"({"op":"anything"})");
  client.SendFrame(2, std::string(4096, 'x'));
  client.SendFrame(9, "are you there?");
  std::optional<Frame> frame;
  do frame = client.Read();
  while (frame && frame->opcode == 1);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->opcode, 10);
  EXPECT_EQ(frame->payload, "are you there?");
  client.SendFrame(1, std::string(4097, 'x'));
  do frame = client.Read();
  while (frame && frame->opcode != 8);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->close_code(), 1009);
}

TEST_F(Server, MalformedFramesEndTheConnection) {
  Start();
  const std::string cookie = CookieOf("vera");
  const std::vector<std::string> cases = {
      std::string("\x81\x03"
                  "abc",
                  5),                                      // not masked
      std::string("\xf1\x80\x11\x22\x33\x44", 6),          // reserved bits
      std::string("\x83\x80\x11\x22\x33\x44", 6),          // reserved opcode
      std::string("\x89\xfe\x00\x80\x11\x22\x33\x44", 8),  // ping of 128 bytes
      std::string("\x09\x80\x11\x22\x33\x44", 6),          // ping in pieces
      std::string("\x81\xff\xff\xff\xff\xff\xff\xff\xff\xff\x11\x22\x33\x44",
                  14),  // 2^64 - 1 bytes
      std::string("\x81\xff\x00\x00\x00\x00\x40\x00\x00\x00\x11\x22\x33\x44", 14),  // a gigabyte
      std::string("\x81\x81\x00\x00\x00\x00\xff", 7),                               // no UTF-8
      std::string("\x80\x81\x11\x22\x33\x44x", 7),         // goes on with nothing
      std::string("\x88\x81\x11\x22\x33\x44x", 7),         // close code of one byte
      std::string("\x88\x82\x00\x00\x00\x00\x03\xed", 8),  // close code 1005
      "GET / HTTP/1.1\r\n\r\n",
  };
  for (const std::string& bad : cases) {
    WireClient client(port_);
    ASSERT_EQ(OpenLive(client, cookie).status, 101);
    client.Send(bad);
    EXPECT_TRUE(client.IsClosedWithin(10s))
        << Json(bad.substr(0, 2)).dump(-1, ' ', true, Json::error_handler_t::replace);
  }
  EXPECT_TRUE(Reaches("tbm_hmi_clients{kind=\"live\"}", 0));
}

TEST_F(Server, ASessionThatEndsTakesItsSocketsAlong) {
  options_.limits.heartbeat = 50ms;
  Start();
  const std::string cookie = CookieOf("otto");
  const std::string other = CookieOf("otto");
  WireClient client(port_);
  WireClient stays(port_);
  ASSERT_EQ(OpenLive(client, cookie).status, 101);
  ASSERT_EQ(OpenLive(stays, other).status, 101);
  WireClient desk(port_);
  EXPECT_EQ(desk.Ask(Post("/api/logout", "", cookie)).status, 204);
  std::optional<Frame> frame;
  do frame = client.Read();
  while (frame && frame->opcode == 1);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->close_code(), 4401);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(NextText(stays).is_object());
  // A tool's as well, when its token goes.
  WireClient tool(port_);
  ASSERT_EQ(tool.Open("/foxglove?token=" + read_token_, "foxglove.websocket.v1", Lines()).status,
            101);
  ASSERT_EQ(auth_->RemoveToken("tool"), std::nullopt);
  do frame = tool.Read();
  while (frame && frame->opcode == 1);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->close_code(), 4401);
}

TEST_F(Server, WhoGivesNoSignIsLetGo) {
  options_.limits.silence = 400ms;
  options_.limits.heartbeat = 50ms;
  Start();
  WireClient client(port_);
  ASSERT_EQ(OpenLive(client, CookieOf("vera")).status, 101);
  EXPECT_TRUE(client.IsClosedWithin(10s)) << "reads all, answers no ping";
}

TEST_F(Server, ASlowConsoleGetsTheNewestAndNoQueue) {
  options_.limits.live_period = 1ms;
  Start();
  WireClient client(port_, WireClient::Tls::kNone, 4096);
  ASSERT_EQ(OpenLive(client, CookieOf("vera")).status, 101);
  ASSERT_TRUE(NextText(client).is_object());
  const std::string padding(20'000, 'x');
  const auto put = [&](int i) {
    source_.Put("guidance", "[" + std::to_string(i) + ",\"" + padding + "\"]");
    server_->Notify();
  };
  // Until nothing gets through any more.
  double sent = -1.0;
  int i = 0;
  while (Metric("tbm_hmi_messages_total{kind=\"live\"}") != sent) {
    sent = Metric("tbm_hmi_messages_total{kind=\"live\"}");
    for (int k = 0; k < 50; ++k) {
      put(++i);
      std::this_thread::sleep_for(2ms);
    }
  }
  EXPECT_LT(sent, 60) << "the kernel holds little";
  for (int k = 0; k < 1000; ++k) put(++i);
  int read = 0;
  int last = 0;
  while (last != i) {
    const Json message = NextText(client);
    ASSERT_TRUE(message.is_object()) << "after " << read << " messages, " << last << " of " << i;
    if (message["sections"].contains("guidance")) last = message["sections"]["guidance"][0];
    ++read;
  }
  EXPECT_LT(read, 70);
}

TEST_F(Server, WhoTakesNothingIsLetGo) {
  options_.limits.live_period = 1ms;
  options_.limits.write = 300ms;
  Start();
  WireClient client(port_, WireClient::Tls::kNone, 4096);
  ASSERT_EQ(OpenLive(client, CookieOf("vera")).status, 101);
  ASSERT_TRUE(Reaches("tbm_hmi_clients{kind=\"live\"}", 1));
  source_.Put("guidance", "\"" + std::string(8'000'000, 'x') + "\"");
  server_->Notify();
  EXPECT_TRUE(Reaches("tbm_hmi_clients{kind=\"live\"}", 0));
  EXPECT_TRUE(Reaches("tbm_hmi_refused_total{reason=\"timeout\"}", 1));
}

TEST_F(Server, ToolsGetTheExactBytes) {
  Start();
  WireClient tool(port_);
  const HttpAnswer answer = tool.Open(
      "/foxglove?token=" + read_token_, "foxglove.sdk.v1, foxglove.websocket.v1", Lines());
  ASSERT_EQ(answer.status, 101);
  EXPECT_EQ(answer.headers.at("sec-websocket-protocol"), "foxglove.websocket.v1");
  const Json info = NextText(tool);
  EXPECT_EQ(info["op"], "serverInfo");
  EXPECT_EQ(info["capabilities"], Json::array());
  const Json advertise = NextText(tool);
  ASSERT_EQ(advertise["channels"].size(), 2u);
  EXPECT_EQ(advertise["channels"][0],
            (Json{{"id", 0},
                  {"topic", "tbm/v1/guidance"},
                  {"encoding", "cdr"},
                  {"schemaName", "tbm::Guidance"},
                  {"schemaEncoding", "omgidl"},
                  {"schema", raw_.Channels()[0].schema_text}}));
  const std::vector<std::byte> cdr = {std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0xfe}};
  EXPECT_FALSE(server_->HasListener(1));
  server_->Publish(1, {77}, cdr);
  tool.SendFrame(1, R"({"op":"subscribe","subscriptions":[{"id":258,"channelId":1}]})");
  for (int i = 0; i < 1000 && !server_->HasListener(1); ++i) std::this_thread::sleep_for(10ms);
  ASSERT_TRUE(server_->HasListener(1));
  EXPECT_FALSE(server_->HasListener(0));
  EXPECT_FALSE(server_->HasListener(99));
  server_->Publish(0, {78}, cdr);
  server_->Publish(1, {0x0102030405060708}, cdr);
  const auto frame = tool.Read();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->opcode, 2);
  EXPECT_EQ(
      frame->payload,
      std::string("\x01\x02\x01\x00\x00\x08\x07\x06\x05\x04\x03\x02\x01\x00\x01\x00\xfe", 17));
  tool.SendFrame(1, R"({"op":"clientPublish"})");
  EXPECT_EQ(NextText(tool)["level"], 1);
  tool.SendFrame(2, std::string("\x01\x00\x00\x00\x00x", 6));
  EXPECT_EQ(NextText(tool)["op"], "status");
  tool.SendFrame(1, R"({"op":"unsubscribe","subscriptionIds":[258]})");
  for (int i = 0; i < 1000 && server_->HasListener(1); ++i) std::this_thread::sleep_for(10ms);
  EXPECT_FALSE(server_->HasListener(1));
  tool.SendFrame(1, R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":0}]})");
  for (int i = 0; i < 1000 && !server_->HasListener(0); ++i) std::this_thread::sleep_for(10ms);
  tool.SendFrame(1, std::string(20'000, ' '));
  EXPECT_TRUE(tool.IsClosedWithin(10s));
  for (int i = 0; i < 1000 && server_->HasListener(0); ++i) std::this_thread::sleep_for(10ms);
  EXPECT_FALSE(server_->HasListener(0)) << "who has left listens no more";
}

TEST_F(Server, ASlowToolLosesTheOldestAndIsToldOnce) {
  options_.limits.waiting_samples = 10;
  Start();
  WireClient tool(port_, WireClient::Tls::kNone, 4096);
  ASSERT_EQ(tool.Open("/foxglove?token=" + read_token_, "foxglove.websocket.v1", Lines()).status,
            101);
  tool.SendFrame(1, R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":0}]})");
  for (int i = 0; i < 1000 && !server_->HasListener(0); ++i) std::this_thread::sleep_for(10ms);
  constexpr int kSamples = 400;
  std::vector<std::byte> cdr(20'000);
  for (int i = 1; i <= kSamples; ++i) server_->Publish(0, {i}, cdr);
  EXPECT_GT(Metric("tbm_hmi_foxglove_dropped_total"), 300);
  std::int64_t last = 0;
  int samples = 0;
  int statuses = 0;
  while (last != kSamples) {
    const auto frame = tool.Read();
    ASSERT_TRUE(frame) << last;
    if (frame->opcode == 1)
      statuses += frame->payload.find("\"status\"") != std::string::npos ? 1 : 0;
    if (frame->opcode != 2) continue;
    std::int64_t stamp = 0;
    std::memcpy(&stamp, frame->payload.data() + 5, sizeof stamp);
    EXPECT_GT(stamp, last) << "in order";
    last = stamp;
    ++samples;
  }
  EXPECT_EQ(statuses, 1);
  EXPECT_EQ(samples + Metric("tbm_hmi_foxglove_dropped_total"), kSamples);
}

TEST_F(Server, TlsIsModernOnly) {
  const auto made = MakeSelfSigned(folder_ / "state", {"127.0.0.1"}, clock_);
  ASSERT_TRUE(made);
  options_.tls = made->files;
  options_.limits.request = 2s;
  Start();
  for (const auto tls : {WireClient::Tls::kAny, WireClient::Tls::kOnly12}) {
    WireClient client(port_, tls);
    ASSERT_TRUE(client.is_open());
    const HttpAnswer health = client.Ask(Get("/healthz"));
    EXPECT_EQ(health.status, 200);
    EXPECT_THAT(health.headers.at("strict-transport-security"), HasSubstr("max-age"));
  }
  EXPECT_FALSE(WireClient(port_, WireClient::Tls::kOnly11).is_open());
  WireClient plain(port_);
  plain.Send(Get("/healthz"));
  EXPECT_TRUE(plain.IsClosedWithin(10s));
  WireClient silent(port_);
  EXPECT_TRUE(silent.IsClosedWithin(10s)) << "no handshake";
  const std::string cookie = CookieOf("vera", WireClient::Tls::kAny);
  EXPECT_THAT(cookie, testing::StartsWith("__Host-tbm_session="));
  WireClient live(port_, WireClient::Tls::kAny);
  ASSERT_EQ(OpenLive(live, cookie).status, 101);
  EXPECT_EQ(NextText(live)["number"], 1);
  WireClient foreign(port_, WireClient::Tls::kAny);
  EXPECT_EQ(
      foreign
          .Open("/api/live", "tbm.console.v1", Lines(cookie) + "Origin: http://" + Host() + "\r\n")
          .status,
      403)
      << "the page of another scheme";
}

TEST_F(Server, WhatIsInTheWayOfStartingIsTold) {
  Start();
  ServerOptions second = options_;
  second.listen = {{"127.0.0.1", port_}, {"127.0.0.1", 0}};
  ConsoleServer other(second, source_, raw_, *auth_, clock_);
  EXPECT_THAT(other.Start(), ElementsAre(HasSubstr("another program listens there already")));
  other.Notify();
  other.Publish(0, {1}, {});
  other.Stop();
}

TEST_F(Server, ThreadsOfTheTopicsAndConsolesDoNotMeet) {
  options_.limits.live_period = 1ms;
  Start();
  const std::string cookie = CookieOf("vera");
  std::atomic<bool> is_over{false};
  const std::vector<std::byte> cdr(200);
  std::vector<std::thread> topics;
  for (int t = 0; t < 2; ++t) {
    topics.emplace_back([&, t] {
      for (int i = 0; !is_over; ++i) {
        source_.Put("guidance", std::to_string(i));
        server_->Notify();
        server_->Publish(static_cast<std::size_t>(t), {i}, cdr);
        std::this_thread::sleep_for(100us);
      }
    });
  }
  for (int round = 0; round < 10; ++round) {
    WireClient live(port_);
    WireClient tool(port_);
    ASSERT_EQ(OpenLive(live, cookie).status, 101);
    ASSERT_EQ(tool.Open("/foxglove?token=" + read_token_, "foxglove.websocket.v1", Lines()).status,
              101);
    tool.SendFrame(
        1, R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":0},{"id":2,"channelId":1}]})");
    for (int i = 0; i < 20; ++i) {
      EXPECT_TRUE(live.Read());
      EXPECT_TRUE(tool.Read());
    }
    if (round == 5) {
      WireClient desk(port_);
      EXPECT_EQ(desk.Ask(Post("/api/logout", "", CookieOf("otto"))).status, 204);
    }
  }
  server_->Stop();  // while they still publish
  is_over = true;
  for (std::thread& topic : topics) topic.join();
  EXPECT_FALSE(WireClient(port_).is_open());
}

}  // namespace
}  // namespace tbm::hmi
