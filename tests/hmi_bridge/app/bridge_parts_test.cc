#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>

#include "hmi_bridge/app/answer_file.h"
#include "hmi_bridge/app/audit_log.h"
#include "hmi_bridge/app/bridge_config.h"
#include "hmi_bridge/app/openapi_text.h"
#include "hmi_bridge/app/web_folder.h"
#include "tests/support/temp_folder.h"

// What the console's process is made of beside DDS and the server.
namespace tbm::hmi {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string kGood = "machine: machine.yaml\nstate: console\n";

std::string FaultsOf(const std::string& yaml) {
  const auto config = ParseBridgeConfig(yaml, "/etc/tbm/hmi_bridge.yaml");
  std::string text;
  if (config) return text;
  for (const RigFileFault& fault : config.error()) text += fault.Text() + "\n";
  return text;
}

TEST(BridgeConfig, PathsAreBesideTheFileAndTheDefaultIsLoopback) {
  const auto config = ParseBridgeConfig(kGood, "/etc/tbm/hmi_bridge.yaml");
  ASSERT_TRUE(config) << FaultsOf(kGood);
  EXPECT_EQ(config->machine_file, "/etc/tbm/machine.yaml");
  EXPECT_EQ(config->state_folder, "/etc/tbm/console");
  ASSERT_EQ(config->listen.size(), 1u);
  EXPECT_EQ(config->listen[0].address, "127.0.0.1");
  EXPECT_EQ(config->listen[0].port, 8080);
  EXPECT_FALSE(config->has_tls());
}

TEST(BridgeConfig, TheExampleSaysTheDefaults) {
  const std::string file = TBM_SOURCE_DIR "/hmi_bridge/app/example/hmi_bridge.yaml";
  const auto example = LoadBridgeConfig(file);
  ASSERT_TRUE(example);
  const auto bare = ParseBridgeConfig(kGood, file);
  ASSERT_TRUE(bare);
  EXPECT_EQ(example->listen[0].port, bare->listen[0].port);
  EXPECT_EQ(example->listen.size(), bare->listen.size());
  EXPECT_EQ(example->names, bare->names);
  EXPECT_EQ(example->web_folder, bare->web_folder);
  EXPECT_EQ(example->dds.domain, bare->dds.domain);
  EXPECT_EQ(example->has_tls(), bare->has_tls());
}

TEST(BridgeConfig, TakesIpv6AndTls) {
  const auto config = ParseBridgeConfig(
      kGood + "listen: ['[::1]:443', '10.0.0.7:0']\ntls: {certificate: c.pem, key: /k.pem}\n",
      "/etc/tbm/hmi_bridge.yaml");
  ASSERT_TRUE(config);
  EXPECT_EQ(config->listen[0].address, "::1");
  EXPECT_EQ(config->listen[0].port, 443);
  EXPECT_EQ(config->tls_certificate_file, "/etc/tbm/c.pem");
  EXPECT_EQ(config->tls_key_file, "/k.pem");
  EXPECT_TRUE(config->has_tls());
}

TEST(BridgeConfig, ACalibrationIsDueAfterItsDays) {
  const auto config = ParseBridgeConfig(
      kGood + "calibrations: [{what: camera, done_on: 2026-05-01, valid_days: 10}]\n", "f");
  ASSERT_TRUE(config);
  ASSERT_EQ(config->calibrations.size(), 1u);
  EXPECT_EQ(config->calibrations[0].done_at.ns, 1'777'593'600'000'000'000);
  EXPECT_EQ(config->calibrations[0].due_at - config->calibrations[0].done_at,
            Duration(std::chrono::hours(240)));
}

struct BadConfig {
  const char* yaml;
  const char* key;
  const char* wanted;
};

TEST(BridgeConfig, EveryFaultNamesFileKeyAndWhatWouldBeRight) {
  const std::vector<BadConfig> cases = {
      {"state: console\n", "machine", "machine.yaml"},
      {"machine: m.yaml\n", "state", "a folder"},
      {"machine: m.yaml\nstate: s\nlisten: []\n", "listen", "127.0.0.1:8080"},
      {"machine: m.yaml\nstate: s\nlisten: ['localhost:80']\n", "localhost:80", "127.0.0.1:8080"},
      {"machine: m.yaml\nstate: s\nlisten: ['127.0.0.1']\n", "127.0.0.1", "port"},
      {"machine: m.yaml\nstate: s\nlisten: ['127.0.0.1:70000']\n", "70000", "port"},
      {"machine: m.yaml\nstate: s\nlisten: ['::1:80']\n", "::1:80", "[::1]:8080"},
      {"machine: m.yaml\nstate: s\ntls: {certificate: c.pem}\n", "tls", "both"},
      {"machine: m.yaml\nstate: s\ntls: {self_signed: true, certificate: c, key: k}\n",
       "self_signed",
       "one of them"},
      {"machine: m.yaml\nstate: s\ntls: {self_signed: maybe}\n", "self_signed", "true"},
      {"machine: m.yaml\nstate: s\ndds: {domain: 999}\n", "domain", "232"},
      {"machine: m.yaml\nstate: s\nport: 80\n", "port", "known here"},
      {"machine: m.yaml\nstate: s\ncalibrations: 5\n", "calibrations", "done_on"},
      {"machine: m.yaml\nstate: s\ncalibrations: [{what: x}]\n", "done_on", "2026-05-01"},
      {"machine: m.yaml\nstate: s\ncalibrations: [{what: x, done_on: 2026-02-30}]\n",
       "2026-02-30",
       "2026-05-01"},
      {"machine: m.yaml\nstate: s\ncalibrations: [{done_on: 2026-02-03}]\n", "what", "camera"},
      {"machine: [1]\nstate: s\n", "machine", "machine"},
      {"- 1\n", "map", "example"},
      {"machine: {", "YAML", "YAML"},
  };
  for (const BadConfig& bad : cases) {
    EXPECT_THAT(
        FaultsOf(bad.yaml),
        AllOf(HasSubstr("/etc/tbm/hmi_bridge.yaml"), HasSubstr(bad.key), HasSubstr(bad.wanted)))
        << bad.yaml;
  }
}

TEST(BridgeConfig, CutFlippedAndGluedBytesAreReadOrRefused) {
  const std::string good = test::ReadText(TBM_SOURCE_DIR "/hmi_bridge/app/example/hmi_bridge.yaml");
  ASSERT_FALSE(good.empty());
  std::size_t refused = 0;
  for (std::size_t i = 0; i < good.size(); i += 3) {
    const auto cut = ParseBridgeConfig(good.substr(0, i), "f");
    EXPECT_TRUE(cut || !cut.error().empty());
    if (!cut) ++refused;
    std::string flipped = good;
    flipped[i] = static_cast<char>(flipped[i] ^ 0x11);
    const auto other = ParseBridgeConfig(flipped, "f");
    EXPECT_TRUE(other || !other.error().empty());
    if (!other) ++refused;
  }
  EXPECT_GT(refused, 100u);
  EXPECT_THAT(FaultsOf(good + good), HasSubstr("machine"));
}

TEST(WebFolder, SaysWhichPageItIs) {
  const test::TempFolder folder;
  std::ofstream(folder / "index.html")
      << "<html><head><meta charset=\"utf-8\"><meta name=\"page-build\" content=\"a1b2\"></head>";
  const auto web = FindWebFolder(folder.path());
  ASSERT_TRUE(web);
  EXPECT_EQ(web->page_build, "a1b2");
}

TEST(WebFolder, WithoutPageSaysWhatMakesIt) {
  const test::TempFolder folder;
  const auto nothing = FindWebFolder(folder.path());
  ASSERT_FALSE(nothing);
  EXPECT_THAT(nothing.error(), AllOf(HasSubstr(folder.path()), HasSubstr("tools/build")));
  std::ofstream(folder / "index.html") << "<html>another page</html>";
  const auto other = FindWebFolder(folder.path());
  ASSERT_FALSE(other);
  EXPECT_THAT(other.error(), HasSubstr("page-build"));
}

TEST(OpenApiText, IsTheContract) {
  EXPECT_TRUE(OpenApiText() == test::ReadText(TBM_SOURCE_DIR "/hmi_bridge/openapi.yaml"));
}

TEST(Answers, SurviveTheDisk) {
  const std::map<std::string, Answer> answers = {
      {"camera_box/camera_silent", {{1'700'000'000'123'456'789}, "ann"}},
      {"a/b", {{-5}, "\"quoted\" \xc3\xa4"}}};
  EXPECT_EQ(AnswersFrom(AnswerText(answers)), answers);
}

TEST(Answers, DamagedOnesAreNoneAndNeverMore) {
  const std::map<std::string, Answer> answers = {{"a/b", {{7}, "ann"}}, {"c/d", {{8}, "bob"}}};
  const std::string text = AnswerText(answers);
  for (std::size_t i = 0; i < text.size(); ++i) {
    for (const std::string& damaged :
         {text.substr(0, i), text + text.substr(0, i), text.substr(i)}) {
      for (const auto& [key, answer] : AnswersFrom(damaged)) {
        EXPECT_TRUE(answers.contains(key) && answers.at(key) == answer) << damaged;
      }
    }
  }
  EXPECT_TRUE(AnswersFrom("[]").empty());
  EXPECT_TRUE(AnswersFrom("{\"a\": {\"by\": 3, \"event_at_utc_ns\": \"x\"}}").empty());
}

std::vector<nlohmann::json> LinesOf(const std::string& path) {
  std::vector<nlohmann::json> lines;
  std::istringstream text(test::ReadText(path));
  for (std::string line; std::getline(text, line);) {
    lines.push_back(nlohmann::json::parse(line, nullptr, false));
  }
  return lines;
}

TEST(AuditLog, ALineForEachAndForItsOwnerAlone) {
  const test::TempFolder folder;
  const std::string file = folder / "audit.log";
  {
    AuditLog log(file, 1'000'000);
    ASSERT_TRUE(log.Add(
        {5}, "ann", Role::kOperator, {"guidance", "shelve", "a 5", "line\nend"}, "sent as 1"));
  }
  {
    AuditLog log(file, 1'000'000);
    ASSERT_TRUE(log.Add({6}, "bob", Role::kViewer, {"guidance", "shelve", "", ""}, "refused: no"));
  }
  const auto lines = LinesOf(file);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0]["user"], "ann");
  EXPECT_EQ(lines[0]["because"], "line\nend");
  EXPECT_EQ(lines[0]["role"], "operator");
  EXPECT_EQ(lines[1]["at_utc_ns"], 6);
  EXPECT_EQ(lines[1]["outcome"], "refused: no");
  struct stat facts {};
  ASSERT_EQ(stat(file.c_str(), &facts), 0);
  EXPECT_EQ(facts.st_mode & 0777, 0600u);
}

TEST(AuditLog, WhatAPowerCutLeftDoesNotSpoilTheNextLine) {
  const test::TempFolder folder;
  const std::string file = folder / "audit.log";
  std::ofstream(file) << "{\"at_utc_ns\":5,\"us";
  AuditLog log(file, 1'000'000);
  ASSERT_TRUE(log.Add({6}, "bob", Role::kViewer, {}, "x"));
  const auto lines = LinesOf(file);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_TRUE(lines[0].is_discarded());
  EXPECT_EQ(lines[1]["user"], "bob");
}

TEST(AuditLog, IsBoundedAndKeepsTheOneBefore) {
  const test::TempFolder folder;
  const std::string file = folder / "audit.log";
  AuditLog log(file, 1000);
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(log.Add({i}, "ann", Role::kOperator, {}, "x"));
  EXPECT_LE(std::filesystem::file_size(file), 1000u);
  EXPECT_LE(std::filesystem::file_size(file + ".1"), 1000u);
  EXPECT_EQ(LinesOf(file).back()["at_utc_ns"], 99);
}

TEST(AuditLog, SaysWhenItCannotBeWritten) {
  AuditLog log("/nowhere/at/all/audit.log", 1000);
  EXPECT_FALSE(log.Add({1}, "ann", Role::kOperator, {}, "x"));
}

}  // namespace
}  // namespace tbm::hmi
