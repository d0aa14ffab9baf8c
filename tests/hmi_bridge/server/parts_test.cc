#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "hmi_bridge/server/foxglove.h"
#include "hmi_bridge/server/live_feed.h"
#include "hmi_bridge/server/rate_limit.h"
#include "hmi_bridge/server/server_core.h"
#include "hmi_bridge/server/server_options.h"
#include "tests/hmi_bridge/server/fake_source.h"
#include "tests/support/fake_clock.h"
#include "tests/support/temp_folder.h"

namespace tbm::hmi {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using namespace std::chrono_literals;
using Json = nlohmann::json;

TEST(LiveFeed, SendsEachVersionOnceAndOnlyTheNewest) {
  const auto text = [](const char* json) { return std::make_shared<const std::string>(json); };
  LiveFeed feed;
  Picture picture{{{"a", 1, text("1")}, {"b", 4, text("[2]")}, {"c", 0, nullptr}}, 1000.5, 7.25};
  EXPECT_EQ(feed.Next(picture),
            R"({"number":1,"at_utc_ms":1000.500,"at_steady_ms":7.250,"sections":{"a":1,"b":[2]}})");
  EXPECT_EQ(feed.Next(picture),
            R"({"number":2,"at_utc_ms":1000.500,"at_steady_ms":7.250,"sections":{}})");
  picture.sections[1] = {"b", 9, text("3")};
  picture.sections[2] = {"c", 1, text("null")};
  EXPECT_EQ(Json::parse(feed.Next(picture))["sections"], Json::parse(R"({"b":3,"c":null})"));
  picture.sections[1] = {"b", 8, text("2.5")};
  EXPECT_EQ(Json::parse(feed.Next(picture))["sections"], Json::object())
      << "older than what was sent";
}

TEST(RateLimit, SoManyAtOnceThenOneInAPeriod) {
  RateLimit limit(3, 10s, 4);
  const RateLimit::SteadyTime start{1h};
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(limit.Take("a", start));
  EXPECT_EQ(limit.Take("a", start), 10s);
  EXPECT_EQ(limit.Take("a", start + 4s), 6s);
  EXPECT_FALSE(limit.Take("b", start));
  EXPECT_FALSE(limit.Take("a", start + 10s));
  EXPECT_TRUE(limit.Take("a", start + 10s));
  limit.GiveBack("a");
  EXPECT_FALSE(limit.Take("a", start + 10s));
  for (int i = 0; i < 100; ++i) limit.Take("key" + std::to_string(i), start + 10s);
  EXPECT_LE(limit.keys(), 4u);
  EXPECT_TRUE(limit.Take("a", start + 10s)) << "a crowd does not let off the one who asks most";
  EXPECT_EQ(RateKey("2001:db8:1:2:3:4:5:6"), RateKey("2001:db8:1:2::9"));
  EXPECT_NE(RateKey("2001:db8:1:2::9"), RateKey("2001:db8:1:3::9"));
  EXPECT_EQ(RateKey("::ffff:10.0.0.1"), "10.0.0.1");
}

TEST(Foxglove, SubscriptionsCountAndNonsenseIsAnswered) {
  FoxgloveSubscriptions subscriptions(2);
  auto outcome = subscriptions.TakeText(
      R"({"op":"subscribe","subscriptions":[{"id":7,"channelId":1},{"id":8,"channelId":1}]})");
  EXPECT_THAT(outcome.begun, ElementsAre(1u));
  EXPECT_TRUE(outcome.answers.empty());
  std::vector<std::uint32_t> ids;
  subscriptions.Each(1, [&](std::uint32_t id) { ids.push_back(id); });
  EXPECT_THAT(ids, ElementsAre(7u, 8u));
  outcome = subscriptions.TakeText(R"({"op":"unsubscribe","subscriptionIds":[7]})");
  EXPECT_TRUE(outcome.ended.empty());
  outcome = subscriptions.TakeText(R"({"op":"unsubscribe","subscriptionIds":[8]})");
  EXPECT_THAT(outcome.ended, ElementsAre(1u));
  EXPECT_TRUE(subscriptions.Channels().empty());
  for (const char* nonsense :
       {"",
        "{",
        "7",
        "[]",
        "{}",
        R"({"op":7})",
        R"({"op":"advertise","channels":[]})",
        R"({"op":"subscribe","subscriptions":[7]})",
        R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":2}]})",
        R"({"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]})",
        R"({"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":1}]})",
        R"({"op":"unsubscribe","subscriptionIds":[1]})",
        R"({"op":"setParameters"})"}) {
    outcome = subscriptions.TakeText(nonsense);
    ASSERT_EQ(outcome.answers.size(), 1u) << nonsense;
    const Json status = Json::parse(outcome.answers[0]);
    EXPECT_EQ(status["op"], "status");
    EXPECT_EQ(status["level"], 1);
    EXPECT_TRUE(outcome.begun.empty());
  }
  EXPECT_EQ(subscriptions.TakeBinary().answers.size(), 1u);
  std::string flood = R"({"op":"subscribe","subscriptions":[)";
  for (int i = 0; i < 400; ++i)
    flood += (i ? ",{\"id\":" : "{\"id\":") + std::to_string(i) + ",\"channelId\":0}";
  outcome = subscriptions.TakeText(flood + "]}");
  EXPECT_LE(outcome.answers.size(), 8u);
  ids.clear();
  subscriptions.Each(0, [&](std::uint32_t id) { ids.push_back(id); });
  EXPECT_EQ(ids.size(), 256u);
}

TEST(Foxglove, TheQueueDropsTheOldest) {
  SampleQueue queue(3, 100);
  const auto sample = [](std::size_t bytes) {
    return std::make_shared<const Sample>(Sample{0, {}, std::vector<std::byte>(bytes)});
  };
  for (std::uint32_t id = 0; id < 4; ++id)
    EXPECT_EQ(queue.Push({id, sample(10)}), id == 3 ? 1u : 0u);
  EXPECT_EQ(queue.Pop().subscription, 1u);
  EXPECT_EQ(queue.Push({9, sample(95)}), 2u);
  EXPECT_EQ(queue.size(), 1u);
  EXPECT_EQ(queue.Push({10, sample(200)}), 2u) << "one that is too large for all of it";
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(queue.size_bytes(), 0u);
}

TEST(ServerOptions, ProblemsAreSentences) {
  ServerOptions options;
  EXPECT_TRUE(Problems(options).empty());
  options.listen = {{"0.0.0.0", 80}, {"localhost", 80}, {"::", 80}, {"127.3.2.1", 80}, {"::1", 80}};
  options.allowed_names = {"tbm-panel", "http://x", "x:80", ""};
  options.tls.reset();
  options.web_folder = "/nowhere";
  const auto problems = Problems(options);
  EXPECT_THAT(problems,
              ElementsAre(HasSubstr("0.0.0.0 is reached from the network: passwords"),
                          HasSubstr("'localhost' is no IPv4 or IPv6 address"),
                          HasSubstr(":: is reached from the network"),
                          HasSubstr("'http://x'"),
                          HasSubstr("'x:80'"),
                          HasSubstr("''"),
                          HasSubstr("/nowhere: cannot be read")));
  options = {};
  options.listen = {{"0.0.0.0", 443}};
  options.tls = TlsFiles{"/nowhere.pem", "/nowhere.key"};
  EXPECT_THAT(Problems(options), ElementsAre(HasSubstr("/nowhere.pem: cannot be read")));
  // A certificate that is still to be made excuses that there is none, and nothing else.
  options.tls.reset();
  EXPECT_TRUE(Problems(options, true).empty());
  options.allowed_names = {"http://x"};
  options.listen.push_back({"localhost", 80});
  EXPECT_THAT(
      Problems(options, true),
      ElementsAre(HasSubstr("'localhost' is no IPv4 or IPv6 address"), HasSubstr("'http://x'")));
  options.allowed_names.clear();
  options.listen.clear();
  EXPECT_THAT(Problems(options), ElementsAre(HasSubstr("no address to listen on")));
}

TEST(Connections, OneAddressGetsItsShareAndThisComputerAll) {
  tbm::test::TempFolder folder;
  tbm::test::FakeClock clock;
  AuthLimits cheap;
  cheap.log2_n = kLeastLog2N;
  const auto auth = std::move(AuthStore::Open(folder / "state", clock, cheap)).value();
  test::FakeSource source;
  test::FakeRaw raw;
  ServerOptions options;
  options.limits.connections = 5;
  options.limits.connections_per_address = 2;
  ServerShared shared(options, source, raw, *auth, clock);
  auto one = shared.Admit("10.0.0.1", false);
  auto two = shared.Admit("10.0.0.1", false);
  EXPECT_NE(two, nullptr);
  EXPECT_EQ(shared.Admit("10.0.0.1", false), nullptr);
  const auto three = shared.Admit("127.0.0.1", true);
  const auto four = shared.Admit("127.0.0.1", true);
  const auto five = shared.Admit("127.0.0.1", true);
  EXPECT_NE(five, nullptr);
  EXPECT_EQ(shared.Admit("127.0.0.1", true), nullptr) << "all are taken";
  one.reset();
  EXPECT_NE(shared.Admit("10.0.0.1", false), nullptr);
  EXPECT_EQ(shared.counters.Refused(Refusal::kTooManyConnections), 2u);
  EXPECT_EQ(shared.counters.connections.load(), 4);
}

}  // namespace
}  // namespace tbm::hmi
