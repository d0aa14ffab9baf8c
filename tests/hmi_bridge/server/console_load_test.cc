#include <algorithm>
#include <atomic>
#include <chrono>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <poll.h>
#include <unistd.h>

#include "tests/hmi_bridge/server/server_fixture.h"
#include "tests/support/process.h"

namespace tbm::hmi {
namespace {

using test::WireClient;
using namespace std::chrono_literals;
using std::chrono::steady_clock;

double Resident_mb() {
  std::ifstream status("/proc/self/statm");
  double pages_all = 0.0;
  double pages = 0.0;
  status >> pages_all >> pages;
  return pages * static_cast<double>(::sysconf(_SC_PAGESIZE)) / 1e6;
}

class Load : public test::ServerTest {
 protected:
  std::unique_ptr<WireClient> Console(const std::string& cookie, int receive_buffer_bytes = 0) {
    auto client = std::make_unique<WireClient>(port_, WireClient::Tls::kNone, receive_buffer_bytes);
    EXPECT_EQ(client->Open("/api/live", "tbm.console.v1", Lines(cookie) + Own()).status, 101);
    return client;
  }
};

// The size of a real step: about 12 kB of JSON at 5 Hz, for everybody.
TEST_F(Load, FiftyConsolesMissNoSecondWhileOneDoesNotRead) {
  constexpr int kConsoles = 50;
  constexpr auto kRun = 6s;
  Start();
  const std::string cookie = CookieOf("vera");
  const auto silent = Console(cookie, 4096);
  std::vector<std::unique_ptr<WireClient>> consoles;
  std::vector<pollfd> ready;
  for (int i = 0; i < kConsoles; ++i) {
    consoles.push_back(Console(cookie));
    ready.push_back({consoles.back()->descriptor(), POLLIN, 0});
  }
  std::atomic<bool> is_over{false};
  std::thread topics([&] {
    const std::string padding(12'000, 'x');
    auto wake = steady_clock::now();
    for (int step = 0; !is_over; ++step) {
      source_.Put("guidance", "[" + std::to_string(step) + ",\"" + padding + "\"]");
      server_->Notify();
      std::this_thread::sleep_until(wake += 200ms);
    }
  });
  const auto start = steady_clock::now();
  std::vector<steady_clock::time_point> last(kConsoles, start);
  std::vector<int> messages(kConsoles, 0);
  auto longest = steady_clock::duration::zero();
  while (steady_clock::now() < start + kRun) {
    if (::poll(ready.data(), ready.size(), 50) <= 0) continue;
    for (std::size_t i = 0; i < ready.size(); ++i) {
      if ((ready[i].revents & POLLIN) == 0) continue;
      while (const auto frame = consoles[i]->Read(5ms)) {
        if (frame->opcode != 1 || frame->payload.size() < 12'000) continue;
        const auto now = steady_clock::now();
        longest = std::max(longest, now - last[i]);
        last[i] = now;
        ++messages[i];
        break;
      }
    }
  }
  is_over = true;
  topics.join();
  for (std::size_t i = 0; i < consoles.size(); ++i) {
    longest = std::max(longest, steady_clock::now() - last[i]);
    EXPECT_GE(messages[i], 5 * 6 - 5) << i;
  }
  const double gap_ms = std::chrono::duration<double, std::milli>(longest).count();
  RecordProperty("longest_gap_ms", std::to_string(gap_ms));
  std::printf("longest gap %.0f ms\n", gap_ms);
  EXPECT_LT(longest, 1s);
}

// foxglove.websocket.v1 as its own client library understands it.
TEST_F(Load, ToolsOwnLibraryUnderstandsUs) {
  options_.product = "tbm test";
  Start();
  const std::string modules = std::string(TBM_SOURCE_DIR) + "/build/npm/node_modules";
  tbm::test::Process node({"node",
                           std::string(TBM_SOURCE_DIR) + "/tests/npm/listen_foxglove.mjs",
                           modules,
                           "ws://" + Host() + "/foxglove?token=" + read_token_,
                           "tbm/v1/event",
                           "3"});
  for (int i = 0; i < 2000 && !server_->HasListener(1); ++i) std::this_thread::sleep_for(10ms);
  ASSERT_TRUE(server_->HasListener(1))
      << node.Output() << "are the packages installed? tools/setup";
  EXPECT_FALSE(server_->HasListener(0));
  for (int i = 1; i <= 3; ++i) {
    const std::vector<std::byte> cdr = {std::byte{0}, std::byte{1}, std::byte(0xa0 + i)};
    server_->Publish(1, {1'790'000'000'000'000'000 + i}, cdr);
  }
  EXPECT_EQ(node.Wait(), 0);
  std::vector<nlohmann::json> lines;
  for (const std::string& line : node.Lines()) {
    lines.push_back(nlohmann::json::parse(line, nullptr, false));
  }
  ASSERT_EQ(lines.size(), 6u) << node.Output();
  EXPECT_EQ(lines[0]["serverInfo"]["name"], "tbm test");
  EXPECT_EQ(lines[0]["serverInfo"]["capabilities"], nlohmann::json::array());
  EXPECT_EQ(lines[1]["channel"]["schema"], raw_.Channels()[0].schema_text);
  EXPECT_EQ(lines[2]["channel"]["topic"], "tbm/v1/event");
  EXPECT_EQ(lines[2]["channel"]["encoding"], "cdr");
  EXPECT_EQ(lines[2]["channel"]["schemaEncoding"], "omgidl");
  EXPECT_EQ(lines[3]["timestamp"], "1790000000000000001");
  EXPECT_EQ(lines[3]["bytes"], "0001a1");
  EXPECT_EQ(lines[5]["bytes"], "0001a3");
}

TEST_F(Load, MemoryIsFlatOverAMillionMessages) {
  constexpr double kMessages = 1e6;
  options_.limits.live_period = 0ms;
  // A console that does not read stands by all the time, and is not let go.
  options_.limits.write = 10min;
  options_.limits.silence = 10min;
  Start();
  const std::string cookie = CookieOf("vera");
  const auto silent = Console(cookie, 4096);
  WireClient silent_tool(port_, WireClient::Tls::kNone, 4096);
  WireClient tool(port_);
  const std::string subscribe = R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":0}]})";
  for (WireClient* client : {&silent_tool, &tool}) {
    ASSERT_EQ(
        client->Open("/foxglove?token=" + read_token_, "foxglove.websocket.v1", Lines()).status,
        101);
    client->SendFrame(1, subscribe);
  }
  const auto console = Console(cookie);
  std::atomic<bool> is_over{false};
  std::thread console_reads([&] {
    while (!is_over) console->ReadAway(100ms);
  });
  std::thread tool_reads([&] {
    while (!is_over) tool.ReadAway(100ms);
  });
  const std::vector<std::byte> cdr(400);
  const auto sent = [&] {
    return Metric("tbm_hmi_messages_total{kind=\"live\"}") +
           Metric("tbm_hmi_messages_total{kind=\"foxglove\"}");
  };
  const auto run_until = [&](double messages) {
    for (int i = 0; sent() < messages; ++i) {
      for (int k = 0; k < 100; ++k) {
        source_.Put("guidance", "[" + std::to_string(i) + "]");
        server_->Notify();
        server_->Publish(0, {i}, cdr);
      }
    }
  };
  // Buffers and arenas have their size after the first tenth.
  run_until(kMessages / 10);
  const double before_mb = Resident_mb();
  const auto start = steady_clock::now();
  run_until(kMessages);
  const double took_s = std::chrono::duration<double>(steady_clock::now() - start).count();
  const double after_mb = Resident_mb();
  is_over = true;
  console_reads.join();
  tool_reads.join();
  std::printf("%.0f messages a second, %.1f MB before, %.1f MB after\n",
              kMessages * 0.9 / took_s,
              before_mb,
              after_mb);
  EXPECT_LT(after_mb, before_mb + 4.0);
}

}  // namespace
}  // namespace tbm::hmi
