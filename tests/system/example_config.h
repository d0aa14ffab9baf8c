#pragma once

#include <string>

#include <gtest/gtest.h>

#include "tests/support/recorded_run.h"
#include "tests/support/temp_folder.h"

namespace tbm::test {

inline std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

// The example's camera_box.yaml and rig.yaml in `folder`, in a DDS domain of the test's own,
// recording, with the serial ports as links in that folder.
inline void WriteExampleConfig(const TempFolder& folder, int domain_id) {
  const std::string example = TBM_SOURCE_DIR "/pose/app/example/";
  std::string config = ReadText(example + "camera_box.yaml");
  config = Replaced(config, "domain: 25", "domain: " + std::to_string(domain_id));
  config = Replaced(config, "# folder: runs", "folder: runs");
  config = Replaced(config, "port: tilt_target", "port: " + (folder / "tilt_target"));
  config = Replaced(config, "port: tilt_camera", "port: " + (folder / "tilt_camera"));
  WriteText(folder / "camera_box.yaml", config);
  WriteText(folder / "rig.yaml", ReadText(example + "rig.yaml"));
}

}  // namespace tbm::test
