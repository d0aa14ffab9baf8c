// guidance.yaml, and the three files a machine is made of, together.
#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/replay/csv.h"
#include "guidance/config/guidance_file.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using ::testing::HasSubstr;

constexpr const char* kGood =
    "machine: site/machine.yaml\n"
    "journal: {folder: journal, file_length_min: 15, limit_mb: 500}\n"
    "dds: {domain: 7, interfaces: [127.0.0.2], initial_peers: [127.0.0.3]}\n";

std::string FaultsOf(const std::string& yaml) {
  const auto config = ParseGuidanceConfig(yaml, "etc/guidance.yaml");
  std::string text;
  if (!config) {
    for (const RigFileFault& fault : config.error()) text += fault.Text() + "\n";
  }
  return text;
}

TEST(GuidanceFile, EachKeyIsRead) {
  const auto config = ParseGuidanceConfig(kGood, "etc/guidance.yaml");
  ASSERT_TRUE(config) << FaultsOf(kGood);
  EXPECT_EQ(config->machine_file, "etc/site/machine.yaml");
  EXPECT_EQ(config->journal_folder, "etc/journal");
  EXPECT_EQ(config->journal_file_length, std::chrono::minutes(15));
  EXPECT_EQ(config->journal_limit_bytes, 500'000'000);
  EXPECT_EQ(config->dds.domain, 7);
  EXPECT_EQ(config->dds.interfaces, std::vector<std::string>{"127.0.0.2"});
  EXPECT_EQ(config->dds.initial_peers, std::vector<std::string>{"127.0.0.3"});
}

TEST(GuidanceFile, TheExampleSaysTheDefaults) {
  const auto example = LoadGuidanceConfig(TBM_SOURCE_DIR "/guidance/app/example/guidance.yaml");
  ASSERT_TRUE(example);
  const GuidanceConfig defaults;
  EXPECT_EQ(example->journal_file_length, defaults.journal_file_length);
  EXPECT_EQ(example->journal_limit_bytes, defaults.journal_limit_bytes);
  EXPECT_EQ(example->dds.domain, defaults.dds.domain);
  EXPECT_EQ(example->dds.interfaces, defaults.dds.interfaces);
}

TEST(GuidanceFile, EachFaultNamesFileLineAndKey) {
  const std::pair<std::string, std::string> cases[] = {
      {"journal: {folder: x}\n", "etc/guidance.yaml:1: machine"},
      {std::string(kGood) + "jurnal: {}\n", "etc/guidance.yaml:4: jurnal"},
      {"machine: m.yaml\njournal: {limit_mb: 1}\n", "etc/guidance.yaml:2: journal.limit_mb"},
      {"machine: m.yaml\njournal: {file_length_min: 0}\n",
       "guidance.yaml:2: journal.file_length_min"},
      {"machine: m.yaml\njournal: {folder: [a]}\n", "guidance.yaml:2: journal.folder"},
      {"machine: m.yaml\njournal: 5\n", "guidance.yaml:2: journal"},
      {"machine: m.yaml\ndds: {domain: 300}\n", "guidance.yaml:2: dds.domain"},
      {"machine: m.yaml\ndds: {interfaces: []}\n", "name at least one address"},
      {"machine: m.yaml\ndds: {interfaces: [eth0]}\n", "'eth0' is not an IPv4 address"},
      {"- machine\n", "is not a map"},
      {"machine: [\n", "not YAML"},
  };
  for (const auto& [yaml, expected] : cases) {
    EXPECT_THAT(FaultsOf(yaml), HasSubstr(expected)) << yaml;
  }
}

// Whatever is cut off or flipped, it is refused with a place or read whole; nothing else.
TEST(GuidanceFile, CutFlippedAndGluedTextIsRefusedOrRead) {
  const std::string good = kGood;
  for (std::size_t length = 0; length < good.size(); ++length) FaultsOf(good.substr(0, length));
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string flipped = good;
    flipped[i] = static_cast<char>(flipped[i] ^ 0x11);
    const auto config = ParseGuidanceConfig(flipped, "f");
    EXPECT_TRUE(config || !config.error().empty());
  }
  EXPECT_THAT(FaultsOf(good + good), HasSubstr("machine"));  // each key stands twice
}

class GuidedMachineFiles : public testing::Test {
 protected:
  GuidedMachineFiles() {
    Copy("guidance/app/example/machine.yaml", "machine.yaml");
    Copy("guidance/app/example/axis.xml", "axis.xml");
    Copy("pose/app/example/rig.yaml", "rig.yaml");
  }
  void Copy(const std::string& from, const std::string& to) {
    std::filesystem::copy_file(std::string(TBM_SOURCE_DIR "/") + from, folder_ / to);
  }
  void Spoil(const std::string& name, const std::string& from, const std::string& to) {
    std::string text = *ReadTextFile(folder_ / name);
    const auto at = text.find(from);
    ASSERT_NE(at, std::string::npos);
    std::ofstream(folder_ / name) << text.replace(at, from.size(), to);
  }
  std::string Faults() {
    MachineFaults warnings;
    const auto machine = LoadGuidedMachine(folder_ / "machine.yaml", &warnings);
    std::string text;
    if (machine) return text;
    for (const std::string& fault : machine.error()) text += fault + "\n";
    return text;
  }

  test::TempFolder folder_;
};

TEST_F(GuidedMachineFiles, AreReadTogether) {
  MachineFaults warnings;
  const auto machine = LoadGuidedMachine(folder_ / "machine.yaml", &warnings);
  ASSERT_TRUE(machine) << Faults();
  EXPECT_TRUE(warnings.empty());
  EXPECT_EQ(machine->rig.leds.size(), 5u);
  EXPECT_EQ(machine->axis.name(), "example tunnel");
  EXPECT_EQ(machine->machine_sha256.size(), 64u);
  EXPECT_EQ(machine->axis_file.content, *ReadTextFile(folder_ / "axis.xml"));
}

TEST_F(GuidedMachineFiles, FaultsOfAllThreeAreTold) {
  Spoil("rig.yaml", "image_width: 1280", "image_width: -1280");
  Spoil("axis.xml", "radiusEnd=\"400.0000\"", "radiusEnd=\"four hundred\"");
  EXPECT_THAT(Faults(), HasSubstr("rig.yaml:"));
  EXPECT_THAT(Faults(), HasSubstr("axis.xml:"));
  Spoil("machine.yaml", "steer_by: cutter_face", "steer_by: nobody");
  EXPECT_THAT(Faults(), HasSubstr("machine.yaml:"));
}

TEST_F(GuidedMachineFiles, AFileThatIsNotThereIsNamed) {
  std::filesystem::remove(folder_ / "axis.xml");
  std::filesystem::remove(folder_ / "rig.yaml");
  EXPECT_THAT(Faults(), testing::AllOf(HasSubstr("axis.xml"), HasSubstr("rig.yaml")));
  std::filesystem::remove(folder_ / "machine.yaml");
  EXPECT_THAT(Faults(), HasSubstr("machine.yaml"));
}

}  // namespace
}  // namespace tbm
